/* Solves one problem: that of a file if there is one, or a chain of two masses that is pushed to rest. */
#include <lpvmpc.h>
#include <stdio.h>
#include <stdlib.h>

enum { NX = 4, NU = 1, N = 20 };

static void must(int code, const char *what)
{
    if (code != LPVMPC_OK) {
        fprintf(stderr, "%s: code %d\n", what, code);
        exit(1);
    }
}

/* Positions and speeds of two masses with springs, in steps of 0.1 s; the force acts on the first. */
static lpvmpc_problem *chain(void)
{
    static const double a[NX * NX] = {1, 0, -0.2, 0.1, 0, 1, 0.1, -0.1, 0.1, 0, 1, 0, 0, 0.1, 0, 1};
    static const double b[NX * NU] = {0, 0, 0.1, 0};
    static const double weight[NX * NX] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0.1, 0, 0, 0, 0, 0.1};
    static const double of_force[] = {0.01}, lower[] = {-1}, upper[] = {1}, x0[NX] = {0.5, 1, 0, 0};
    const struct lpvmpc_stage stage = {
        .a = a, .b = b, .q = weight, .r = of_force, .u_lower = lower, .u_upper = upper};
    const struct lpvmpc_end end = {.p = weight};
    lpvmpc_problem *problem;
    must(lpvmpc_problem_new(NX, NU, N, 0, 1, &problem), "problem");
    for (int i = 0; i < N; i++)
        must(lpvmpc_problem_set_stage(problem, i, &stage), "stage");
    must(lpvmpc_problem_set_end(problem, &end), "end");
    must(lpvmpc_problem_set_x0(problem, x0), "x_0");
    return problem;
}

int main(int argc, char **argv)
{
    lpvmpc_problem *problem;
    lpvmpc_solver *solver;
    int status, active, changes;
    double cost, residual;
    if (argc > 1)
        must(lpvmpc_problem_read(argv[1], 0, &problem), argv[1]);
    else
        problem = chain();
    must(lpvmpc_solver_new(problem, &solver), "solver");
    must(lpvmpc_solve(solver, problem, LPVMPC_COLD), "solve");
    must(lpvmpc_status(solver, &status), "status");
    must(lpvmpc_active(solver, &active, &changes), "active bounds");
    must(lpvmpc_cost(solver, &cost), "cost");
    must(lpvmpc_kkt_residual(solver, problem, &residual), "residual");
    printf("status %d, cost %.6g, %d active bounds after %d changes, residual %.1e\n", status, cost, active,
           changes, residual);
    if (argc == 1) {
        double u[N * NU];
        must(lpvmpc_inputs(solver, u, N * NU), "inputs");
        for (int i = 0; i < N * NU; i++)
            printf("%s%.4f", i ? " " : "u ", u[i]);
        printf("\n");
    }
    lpvmpc_solver_free(solver);
    lpvmpc_problem_free(problem);
    return status;
}
