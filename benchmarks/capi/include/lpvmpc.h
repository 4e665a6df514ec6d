/* The solver of lpvmpc for C: linear-quadratic problems with stages and bounds,
 *
 *   min  sum_{i<N} x_i'Q x_i/2 + u_i'S x_i + u_i'R u_i/2 + q'x_i + r'u_i  +  x_N'P x_N/2 + p'x_N
 *   with x_{i+1} = A x_i + B u_i + c,  x_0 given,
 *        bounds on u_i, on x_i (i > 0), and on general rows  C x_i + D u_i.
 *
 * A bound of a state or of a row may be soft: an excess s costs linear*s + quadratic*s^2/2.
 * Matrices are stored by columns. Infinite bounds are absent.
 *
 * Sizes (states x inputs): 4x1, 8x2, 12x4, 16x6.
 *
 * Functions that return int return LPVMPC_OK or why they have done nothing. Different solvers may be
 * used by different threads at once; one solver by one thread at a time. */
#ifndef LPVMPC_H
#define LPVMPC_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

enum lpvmpc_code {
    LPVMPC_OK = 0,
    LPVMPC_NULL = -1,  /* a pointer that must not be null is */
    LPVMPC_SIZE = -2,  /* a size, stage or choice that there is not, or things of different sizes */
    LPVMPC_FILE = -3,  /* a file that cannot be read */
    LPVMPC_PANIC = -4, /* a defect of the library; what was to be changed can only be freed */
};

/* What an answer is worth. Whatever it is, the inputs are finite and within their bounds. */
enum lpvmpc_status {
    LPVMPC_SOLVED = 0,
    LPVMPC_INFEASIBLE = 1,
    LPVMPC_INACCURATE = 2,   /* rounding keeps a bound from being met as closely as asked for */
    LPVMPC_MAX_CHANGES = 3,
    LPVMPC_WORKING_SET_FULL = 4,
    LPVMPC_HORIZON_TOO_LONG = 5,
    LPVMPC_NUMERICAL_FAILURE = 6, /* R + B'PB is not positive definite */
    LPVMPC_NOT_FINITE = 7,
};

/* Where the search for the active bounds begins. It changes the time, never the answer. */
enum lpvmpc_start {
    LPVMPC_COLD = 0,    /* from nothing */
    LPVMPC_SAME = 1,    /* from the bounds of the last answer, at the same stages */
    LPVMPC_SHIFTED = 2, /* from those, one stage earlier */
};

/* Parts of a stage; null leaves what there is. `rows` is the number of general rows. */
struct lpvmpc_stage {
    const double *a;                  /* NX x NX */
    const double *b;                  /* NX x NU */
    const double *c;                  /* NX */
    const double *q;                  /* NX x NX, symmetric positive semidefinite */
    const double *r;                  /* NU x NU, symmetric */
    const double *s;                  /* NU x NX */
    const double *linear_x;           /* NX, q in the formula above */
    const double *linear_u;           /* NU, r in the formula above */
    const double *x_lower, *x_upper;  /* NX */
    const double *x_linear;           /* NX, price of an excess; infinite: the bound is hard */
    const double *x_quadratic;        /* NX */
    const double *u_lower, *u_upper;  /* NU */
    const double *rows_x;             /* rows x NX, C in the formula above */
    const double *rows_u;             /* rows x NU, D in the formula above */
    const double *rows_lower, *rows_upper; /* rows */
    const double *rows_linear;        /* rows, price as above */
    const double *rows_quadratic;     /* rows */
};

/* Parts of the end of the horizon; null leaves what there is. */
struct lpvmpc_end {
    const double *p;                  /* NX x NX, symmetric positive semidefinite */
    const double *linear_x;           /* NX */
    const double *x_lower, *x_upper;  /* NX */
    const double *x_linear, *x_quadratic;
    const double *rows_x;             /* rows x NX */
    const double *rows_lower, *rows_upper;
    const double *rows_linear, *rows_quadratic;
};

typedef struct lpvmpc_problem lpvmpc_problem;
typedef struct lpvmpc_solver lpvmpc_solver;

/* A problem with unit input weights, no other cost and no bounds. With `common` not 0, weights and
 * bounds of x and u are kept once: what is set for a stage holds at all of them. */
int lpvmpc_problem_new(int nx, int nu, int horizon, int rows, int common, lpvmpc_problem **out);
/* Problem `number`, from 0, of a problem file. */
int lpvmpc_problem_read(const char *path, int number, lpvmpc_problem **out);
void lpvmpc_problem_free(lpvmpc_problem *problem);
int lpvmpc_problem_set_x0(lpvmpc_problem *problem, const double *x0);
int lpvmpc_problem_set_stage(lpvmpc_problem *problem, int number, const struct lpvmpc_stage *stage);
int lpvmpc_problem_set_end(lpvmpc_problem *problem, const struct lpvmpc_end *end);
/* Everything, as it stands in a problem file; `count` numbers. */
int lpvmpc_problem_set_all(lpvmpc_problem *problem, const double *all, size_t count);

/* A solver with memory for problems with the sizes and kinds of bounds of `like`. */
int lpvmpc_solver_new(const lpvmpc_problem *like, lpvmpc_solver **out);
void lpvmpc_solver_free(lpvmpc_solver *solver);

/* Solves; `start` is an lpvmpc_start. LPVMPC_OK says that it has run: ask for the status. */
int lpvmpc_solve(lpvmpc_solver *solver, const lpvmpc_problem *problem, int start);
/* Forgets the last active bounds, so that the next start is a cold one. */
int lpvmpc_forget(lpvmpc_solver *solver);

/* Of the last answer: an lpvmpc_status; u_0 to u_{N-1} (`count` = N NU); x_1 to x_N (`count` = N NX);
 * the cost; active bounds (one that is exceeded at both prices counts twice) and changes of the active
 * set; the largest residual of the optimality conditions of `problem`, relative. */
int lpvmpc_status(const lpvmpc_solver *solver, int *out);
int lpvmpc_inputs(const lpvmpc_solver *solver, double *u, size_t count);
int lpvmpc_states(const lpvmpc_solver *solver, double *x, size_t count);
int lpvmpc_cost(const lpvmpc_solver *solver, double *out);
int lpvmpc_active(const lpvmpc_solver *solver, int *active, int *changes);
int lpvmpc_kkt_residual(const lpvmpc_solver *solver, const lpvmpc_problem *problem, double *out);

/* Does nothing, so that the time of a call can be taken. */
int lpvmpc_nothing(void);

#ifdef __cplusplus
}
#endif

#endif
