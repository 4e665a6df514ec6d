/* HPIPM as a contender. x_0, which is given, is taken out of the problem beforehand, and only bounds that
 * there are become constraints. */
#include "contender.h"

#include <hpipm_d_ocp_qp.h>
#include <hpipm_d_ocp_qp_dim.h>
#include <hpipm_d_ocp_qp_ipm.h>
#include <hpipm_d_ocp_qp_kkt.h>
#include <hpipm_d_ocp_qp_sol.h>
#include <hpipm_d_part_cond.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define MOST 64 /* more than there are bounds of a stage */
#define ITERATIONS 100

struct hpipm {
    const struct sequence *sequence;
    struct choices choices;
    struct d_ocp_qp_dim dim, condensed_dim;
    struct d_ocp_qp *qps; /* one for each problem */
    struct d_ocp_qp condensed;
    struct d_ocp_qp_sol sol, condensed_sol;
    struct d_ocp_qp_ipm_arg arg;
    struct d_ocp_qp_ipm_ws ws;
    struct d_part_cond_qp_arg cond_arg;
    struct d_part_cond_qp_ws cond_ws;
    int *block_size;
    void *memory[64];
    int used;
};

/* Bounds of a stage that there are. */
struct bounds {
    int nbu, nbx, ng, ns;
    int idxbu[MOST], idxbx[MOST], row[MOST], idxs[MOST];
    double linear[MOST], quadratic[MOST];
};

static void *memory(struct hpipm *h, size_t size)
{
    void *place = NULL;
    if (h->used == (int)(sizeof h->memory / sizeof *h->memory) ||
        posix_memalign(&place, 64, size + 64)) {
        fprintf(stderr, "out of memory\n");
        exit(1);
    }
    h->memory[h->used++] = place;
    return place;
}

static int bounded(double lower, double upper)
{
    return isfinite(lower) || isfinite(upper);
}

static void soften(struct bounds *b, int place, double linear, double quadratic)
{
    if (!isfinite(linear))
        return;
    b->idxs[b->ns] = place;
    b->linear[b->ns] = linear;
    b->quadratic[b->ns++] = quadratic;
}

static struct bounds bounds_of(const struct sequence *s, int k, int i)
{
    struct bounds b = {0};
    int end = i == s->horizon;
#define PART(stage, of_end) sequence_part(s, k, i, end ? (int)(of_end) : (int)(stage))
    const double *x_lower = PART(PART_X_LOWER, END_X_LOWER), *x_upper = PART(PART_X_UPPER, END_X_UPPER);
    const double *rows_lower = PART(PART_ROWS_LOWER, END_ROWS_LOWER);
    const double *rows_upper = PART(PART_ROWS_UPPER, END_ROWS_UPPER);
    for (int j = 0; !end && j < s->nu; j++)
        if (bounded(sequence_part(s, k, i, PART_U_LOWER)[j], sequence_part(s, k, i, PART_U_UPPER)[j]))
            b.idxbu[b.nbu++] = j;
    for (int j = 0; i > 0 && j < s->nx; j++)
        if (bounded(x_lower[j], x_upper[j])) {
            b.idxbx[b.nbx] = j;
            soften(&b, b.nbu + b.nbx++, PART(PART_X_LINEAR, END_X_LINEAR)[j],
                   PART(PART_X_QUADRATIC, END_X_QUADRATIC)[j]);
        }
    for (int j = 0; j < s->rows; j++)
        if (bounded(rows_lower[j], rows_upper[j])) {
            b.row[b.ng] = j;
            soften(&b, b.nbu + b.nbx + b.ng++, PART(PART_ROWS_LINEAR, END_ROWS_LINEAR)[j],
                   PART(PART_ROWS_QUADRATIC, END_ROWS_QUADRATIC)[j]);
        }
#undef PART
    return b;
}

typedef void (*setter)(int, double *, struct d_ocp_qp *);

/* One side of bounds: an infinite one is masked. */
static void set_side(setter value, setter mask, int i, int count, const int *which, const double *from,
                     struct d_ocp_qp *qp)
{
    double values[MOST], masks[MOST];
    for (int j = 0; j < count; j++) {
        masks[j] = isfinite(from[which[j]]);
        values[j] = masks[j] != 0 ? from[which[j]] : 0;
    }
    if (count > 0) {
        value(i, values, qp);
        mask(i, masks, qp);
    }
}

static void set_bounds(const struct sequence *s, int k, int i, const struct bounds *b,
                       struct d_ocp_qp *qp)
{
    int end = i == s->horizon;
    int first = end ? END_X_LOWER : PART_X_LOWER;
    d_ocp_qp_set_idxbu(i, (int *)b->idxbu, qp);
    d_ocp_qp_set_idxbx(i, (int *)b->idxbx, qp);
    if (!end) {
        set_side(d_ocp_qp_set_lbu, d_ocp_qp_set_lbu_mask, i, b->nbu, b->idxbu,
                 sequence_part(s, k, i, PART_U_LOWER), qp);
        set_side(d_ocp_qp_set_ubu, d_ocp_qp_set_ubu_mask, i, b->nbu, b->idxbu,
                 sequence_part(s, k, i, PART_U_UPPER), qp);
    }
    set_side(d_ocp_qp_set_lbx, d_ocp_qp_set_lbx_mask, i, b->nbx, b->idxbx,
             sequence_part(s, k, i, first), qp);
    set_side(d_ocp_qp_set_ubx, d_ocp_qp_set_ubx_mask, i, b->nbx, b->idxbx,
             sequence_part(s, k, i, first + 1), qp);
    if (b->ns > 0) {
        double zeros[MOST] = {0};
        d_ocp_qp_set_idxs(i, (int *)b->idxs, qp);
        d_ocp_qp_set_zl(i, (double *)b->linear, qp);
        d_ocp_qp_set_zu(i, (double *)b->linear, qp);
        d_ocp_qp_set_Zl(i, (double *)b->quadratic, qp);
        d_ocp_qp_set_Zu(i, (double *)b->quadratic, qp);
        d_ocp_qp_set_lls(i, zeros, qp);
        d_ocp_qp_set_lus(i, zeros, qp);
    }
}

/* General rows; at stage 0 the given state goes to the other side. */
static void set_rows(const struct sequence *s, int k, int i, const struct bounds *b, struct d_ocp_qp *qp)
{
    if (b->ng == 0)
        return;
    int end = i == s->horizon, nx = i == 0 ? 0 : s->nx;
    const double *x0 = sequence_problem(s, k);
    const double *of_x = sequence_part(s, k, i, end ? (int)END_ROWS_X : (int)PART_ROWS_X);
    int first = end ? END_ROWS_LOWER : PART_ROWS_LOWER;
    double *c = calloc(b->ng * (size_t)s->nx, sizeof *c), *d = calloc(b->ng * (size_t)s->nu, sizeof *d);
    double lower[MOST], upper[MOST];
    int all[MOST];
    for (int j = 0; j < b->ng; j++) {
        int row = b->row[j];
        double shift = 0;
        all[j] = j;
        for (int column = 0; column < s->nx; column++) {
            double entry = of_x[column * s->rows + row];
            if (nx > 0)
                c[column * b->ng + j] = entry;
            else
                shift += entry * x0[column];
        }
        for (int column = 0; !end && column < s->nu; column++)
            d[column * b->ng + j] = sequence_part(s, k, i, PART_ROWS_U)[column * s->rows + row];
        lower[j] = sequence_part(s, k, i, first)[row] - shift;
        upper[j] = sequence_part(s, k, i, first + 1)[row] - shift;
    }
    if (nx > 0)
        d_ocp_qp_set_C(i, c, qp);
    if (!end)
        d_ocp_qp_set_D(i, d, qp);
    set_side(d_ocp_qp_set_lg, d_ocp_qp_set_lg_mask, i, b->ng, all, lower, qp);
    set_side(d_ocp_qp_set_ug, d_ocp_qp_set_ug_mask, i, b->ng, all, upper, qp);
    free(c);
    free(d);
}

/* Dynamics and cost of a stage, without x_0. */
static void set_stage(const struct sequence *s, int k, int i, struct d_ocp_qp *qp)
{
#define PART(part) ((double *)sequence_part(s, k, i, part))
    if (i == s->horizon) {
        d_ocp_qp_set_Q(i, PART(END_P), qp);
        d_ocp_qp_set_q(i, PART(END_LINEAR_X), qp);
        return;
    }
    double b[MOST], r[MOST];
    const double *x0 = sequence_problem(s, k), *a = PART(PART_A), *cross = PART(PART_S);
    for (int row = 0; row < s->nx; row++) {
        b[row] = PART(PART_C)[row];
        for (int column = 0; i == 0 && column < s->nx; column++)
            b[row] += a[column * s->nx + row] * x0[column];
    }
    for (int row = 0; row < s->nu; row++) {
        r[row] = PART(PART_LINEAR_U)[row];
        for (int column = 0; i == 0 && column < s->nx; column++)
            r[row] += cross[column * s->nu + row] * x0[column];
    }
    d_ocp_qp_set_B(i, PART(PART_B), qp);
    d_ocp_qp_set_b(i, b, qp);
    d_ocp_qp_set_R(i, PART(PART_R), qp);
    d_ocp_qp_set_r(i, r, qp);
    if (i > 0) {
        d_ocp_qp_set_A(i, PART(PART_A), qp);
        d_ocp_qp_set_Q(i, PART(PART_Q), qp);
        d_ocp_qp_set_S(i, PART(PART_S), qp);
        d_ocp_qp_set_q(i, PART(PART_LINEAR_X), qp);
    }
#undef PART
}

/* The problems of a sequence, with bounds or without. */
static struct hpipm *load(const struct sequence *s, int with_bounds)
{
    struct hpipm *h = calloc(1, sizeof *h);
    struct bounds none = {0};
    h->sequence = s;
    d_ocp_qp_dim_create(s->horizon, &h->dim, memory(h, d_ocp_qp_dim_memsize(s->horizon)));
    for (int i = 0; i <= s->horizon; i++) {
        struct bounds b = with_bounds ? bounds_of(s, 0, i) : none;
        d_ocp_qp_dim_set_nx(i, i == 0 ? 0 : s->nx, &h->dim);
        d_ocp_qp_dim_set_nu(i, i == s->horizon ? 0 : s->nu, &h->dim);
        d_ocp_qp_dim_set_nbx(i, b.nbx, &h->dim);
        d_ocp_qp_dim_set_nbu(i, b.nbu, &h->dim);
        d_ocp_qp_dim_set_ng(i, b.ng, &h->dim);
        d_ocp_qp_dim_set_ns(i, b.ns, &h->dim);
    }
    h->qps = memory(h, s->problems * sizeof *h->qps);
    for (int k = 0; k < s->problems; k++) {
        struct d_ocp_qp *qp = &h->qps[k];
        d_ocp_qp_create(&h->dim, qp, memory(h, d_ocp_qp_memsize(&h->dim)));
        for (int i = 0; i <= s->horizon; i++) {
            set_stage(s, k, i, qp);
            if (with_bounds) {
                struct bounds b = bounds_of(s, k, i);
                set_bounds(s, k, i, &b, qp);
                set_rows(s, k, i, &b, qp);
            }
        }
    }
    d_ocp_qp_sol_create(&h->dim, &h->sol, memory(h, d_ocp_qp_sol_memsize(&h->dim)));
    return h;
}

static void choose(struct hpipm *h, struct choices choices, struct d_ocp_qp_dim *dim)
{
    int iterations = ITERATIONS, off = 0;
    double tolerance = choices.tolerance;
    h->choices = choices;
    d_ocp_qp_ipm_arg_create(dim, &h->arg, memory(h, d_ocp_qp_ipm_arg_memsize(dim)));
    d_ocp_qp_ipm_arg_set_default(choices.mode == MODE_SPEED_ABS ? SPEED_ABS : BALANCE, &h->arg);
    d_ocp_qp_ipm_arg_set_iter_max(&iterations, &h->arg);
    d_ocp_qp_ipm_arg_set_mu0(&choices.mu0, &h->arg);
    d_ocp_qp_ipm_arg_set_tol_stat(&tolerance, &h->arg);
    d_ocp_qp_ipm_arg_set_tol_eq(&tolerance, &h->arg);
    d_ocp_qp_ipm_arg_set_tol_ineq(&tolerance, &h->arg);
    d_ocp_qp_ipm_arg_set_tol_comp(&tolerance, &h->arg);
    /* A factorisation at the answer, which only sensitivities need. */
    d_ocp_qp_ipm_arg_set_update_fact_exit(&off, &h->arg);
    d_ocp_qp_ipm_ws_create(dim, &h->arg, &h->ws, memory(h, d_ocp_qp_ipm_ws_memsize(dim, &h->arg)));
}

static void solve_as_it_is(void *self, int problem)
{
    struct hpipm *h = self;
    h->arg.warm_start = problem == 0 ? 0 : h->choices.warm_start;
    d_ocp_qp_ipm_solve(&h->qps[problem], &h->sol, &h->arg, &h->ws);
}

static void solve_condensed(void *self, int problem)
{
    struct hpipm *h = self;
    h->arg.warm_start = problem == 0 ? 0 : h->choices.warm_start;
    d_part_cond_qp_cond(&h->qps[problem], &h->condensed, &h->cond_arg, &h->cond_ws);
    d_ocp_qp_ipm_solve(&h->condensed, &h->condensed_sol, &h->arg, &h->ws);
    d_part_cond_qp_expand_sol(&h->qps[problem], &h->condensed_sol, &h->sol, &h->cond_arg, &h->cond_ws);
}

static void solve_riccati(void *self, int problem)
{
    struct hpipm *h = self;
    d_ocp_qp_fact_solve_kkt_unconstr(&h->qps[problem], &h->sol, &h->arg, &h->ws);
}

static int first_input(void *self, double *u0)
{
    struct hpipm *h = self;
    int status;
    d_ocp_qp_sol_get_u(0, &h->sol, u0);
    d_ocp_qp_ipm_get_status(&h->ws, &status);
    return status;
}

static int first_input_riccati(void *self, double *u0)
{
    struct hpipm *h = self;
    d_ocp_qp_sol_get_u(0, &h->sol, u0);
    return 0;
}

static void hpipm_free(void *self)
{
    struct hpipm *h = self;
    for (int place = 0; place < h->used; place++)
        free(h->memory[place]);
    free(h->block_size);
    free(h);
}

static void condense(struct hpipm *h, int blocks)
{
    int n = h->sequence->horizon, off = 0;
    h->block_size = calloc(blocks + 1, sizeof(int));
    d_part_cond_qp_compute_block_size(n, blocks, h->block_size);
    d_ocp_qp_dim_create(blocks, &h->condensed_dim, memory(h, d_ocp_qp_dim_memsize(blocks)));
    d_part_cond_qp_compute_dim(&h->dim, h->block_size, &h->condensed_dim);
    d_part_cond_qp_arg_create(blocks, &h->cond_arg, memory(h, d_part_cond_qp_arg_memsize(blocks)));
    d_part_cond_qp_arg_set_default(&h->cond_arg);
    /* Of the answer, inputs and states are wanted. */
    d_part_cond_qp_arg_set_comp_dual_sol_eq(off, &h->cond_arg);
    d_part_cond_qp_arg_set_comp_dual_sol_ineq(off, &h->cond_arg);
    d_ocp_qp_create(&h->condensed_dim, &h->condensed, memory(h, d_ocp_qp_memsize(&h->condensed_dim)));
    d_ocp_qp_sol_create(&h->condensed_dim, &h->condensed_sol,
                        memory(h, d_ocp_qp_sol_memsize(&h->condensed_dim)));
    d_part_cond_qp_ws_create(&h->dim, h->block_size, &h->condensed_dim, &h->cond_arg, &h->cond_ws,
                             memory(h, d_part_cond_qp_ws_memsize(&h->dim, h->block_size,
                                                                 &h->condensed_dim, &h->cond_arg)));
}

static struct contender *contender_of(struct hpipm *h)
{
    struct contender *c = calloc(1, sizeof *c);
    c->self = h;
    c->first_input = first_input;
    c->free = hpipm_free;
    return c;
}

struct contender *hpipm_new(const struct sequence *s, struct choices choices)
{
    struct hpipm *h = load(s, 1);
    int condensed = choices.blocks < s->horizon;
    if (condensed)
        condense(h, choices.blocks);
    choose(h, choices, condensed ? &h->condensed_dim : &h->dim);
    struct contender *c = contender_of(h);
    static const char *const starts[] = {"cold", "warm primal", "warm"};
    snprintf(c->name, sizeof c->name, "HPIPM %s",
             choices.mode == MODE_SPEED_ABS ? "SPEED_ABS" : "BALANCE");
    snprintf(c->variant, sizeof c->variant, "%s", starts[choices.warm_start]);
    c->solve = condensed ? solve_condensed : solve_as_it_is;
    return c;
}

int hpipm_iterations(const struct contender *c)
{
    struct hpipm *h = c->self;
    int iterations;
    d_ocp_qp_ipm_get_iter(&h->ws, &iterations);
    return iterations;
}

struct contender *hpipm_riccati_new(const struct sequence *s, int square_root)
{
    struct choices choices = {MODE_SPEED_ABS, s->horizon, 1, 1, 0};
    struct hpipm *h = load(s, 0);
    choose(h, choices, &h->dim);
    d_ocp_qp_ipm_arg_set_ric_alg(&square_root, &h->arg);
    struct contender *c = contender_of(h);
    snprintf(c->name, sizeof c->name, "HPIPM Riccati");
    snprintf(c->variant, sizeof c->variant, "%s", square_root ? "square root" : "classical");
    c->solve = solve_riccati;
    c->first_input = first_input_riccati;
    return c;
}
