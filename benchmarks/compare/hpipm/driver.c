/* Times HPIPM and our solver, interleaved, on problem files:
 *
 *   driver --ours NAME=LIBRARY [--ours NAME=LIBRARY]... [--out CSV] [--seconds S] [--quick] FILE...
 *
 * --seconds is the time for a file, --quick leaves out what has not been the best choice for HPIPM as a
 * rule. What is timed, and what not, is said in ../README.md. */
#include "contender.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { MOST_LIBRARIES = 4, MOST_CONTENDERS = 32, MOST_INPUTS = 16, TRIAL_SWEEPS = 3, LEAST_SWEEPS = 6, MOST_SWEEPS = 50 };

/* An answer is exact enough if u_0 is off by no more than this, relative to the largest first input of the
 * sequence. */
static const double EXACT = 1e-6;
/* What is farther off is no answer. */
static const double ROUGH = 1e-2;
/* A contender that takes longer for one sweep is slow [s]. */
static const double SLOW = 0.5;
/* Barrier parameters to begin with: HPIPM's default is the first. */
static const double MU0[] = {10, 1, 0.1};
/* Tolerances; with the first, answers can be too far off. */
static const double TOLERANCES[] = {1e-8, 1e-10, 1e-12};
/* Stages after partial condensing: the horizon divided by these. */
static const int DIVISORS[] = {1, 2, 3, 5, 10};

struct options {
    struct library *libraries[MOST_LIBRARIES];
    int libraries_count;
    FILE *out;
    double seconds;
    int quick;
};

struct race {
    const struct sequence *sequence;
    struct contender *contenders[MOST_CONTENDERS];
    int count;
    double *reference; /* first inputs of our cold start */
    double largest;    /* the largest of them */
    double residual;   /* of our answers */
    double active;     /* of our answers, on average */
};

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

static void enter(struct race *r, struct contender *c)
{
    int problems = r->sequence->problems;
    c->shortest = malloc(problems * sizeof(double));
    c->u0 = calloc((size_t)problems * r->sequence->nu, sizeof(double));
    for (int k = 0; k < problems; k++)
        c->shortest[k] = INFINITY;
    r->contenders[r->count++] = c;
}

/* Once through the sequence. */
static void sweep(const struct race *r, struct contender *c)
{
    c->failures = 0;
    for (int k = 0; k < r->sequence->problems; k++) {
        double begin = now();
        c->solve(c->self, k);
        double time = now() - begin;
        if (time < c->shortest[k])
            c->shortest[k] = time;
        c->failures += c->first_input(c->self, c->u0 + k * r->sequence->nu) != 0;
    }
}

/* All contenders in turn, at least so often and until the time is over; those that are slow only once. */
static void run(struct race *r, int least, double seconds)
{
    double end = now() + seconds;
    int slow[MOST_CONTENDERS] = {0};
    for (int turn = 0; turn < least || (now() < end && turn < MOST_SWEEPS); turn++)
        for (int i = 0; i < r->count; i++) {
            double begin = now();
            if (slow[i])
                continue;
            sweep(r, r->contenders[i]);
            slow[i] = now() - begin > SLOW;
        }
}

static int ascending(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(const double *values, int count)
{
    double sorted[count];
    memcpy(sorted, values, count * sizeof(double));
    qsort(sorted, count, sizeof(double), ascending);
    return 0.5 * (sorted[(count - 1) / 2] + sorted[count / 2]);
}

static double worst(const double *values, int count)
{
    double most = 0;
    for (int k = 0; k < count; k++)
        most = fmax(most, values[k]);
    return most;
}

/* The largest difference to the reference's first inputs, relative; infinite where a number is none. */
static double error_of(const struct race *r, const struct contender *c)
{
    double most = 0;
    for (int place = 0; place < r->sequence->problems * r->sequence->nu; place++) {
        double error = fabs(c->u0[place] - r->reference[place]) / r->largest;
        if (!(error <= most))
            most = isnan(error) ? INFINITY : error;
    }
    return most;
}

/* Our answers are what the others are compared with, and judged by the optimality conditions themselves. */
static void take_reference(struct race *r, struct library *library, int bounded)
{
    const struct sequence *s = r->sequence;
    struct contender *c = own_new(library, s, 0, bounded);
    r->reference = calloc((size_t)s->problems * s->nu, sizeof(double));
    r->largest = 1e-300;
    for (int k = 0; k < s->problems; k++) {
        double residual, *u0 = r->reference + k * s->nu;
        int active;
        c->solve(c->self, k);
        if (c->first_input(c->self, u0) != 0)
            fprintf(stderr, "%s: problem %d is not solved by %s\n", s->kind, k, c->name);
        own_answer(c, k, &residual, &active);
        r->residual = fmax(r->residual, residual);
        r->active += (double)active / s->problems;
        for (int j = 0; j < s->nu; j++)
            r->largest = fmax(r->largest, fabs(u0[j]));
    }
    contender_free(c);
}

static void clear(struct race *r)
{
    for (int i = 0; i < r->count; i++)
        contender_free(r->contenders[i]);
    r->count = 0;
}

#define LENGTH(array) (sizeof(array) / sizeof *(array))

/* The median time with these choices; infinite where a problem is left unsolved, or where an answer is
 * farther off than `exact`. */
static double try_choices(const struct race *of, struct choices choices, double exact)
{
    struct race trial = *of;
    trial.count = 0;
    enter(&trial, hpipm_new(of->sequence, choices));
    run(&trial, TRIAL_SWEEPS, 0);
    struct contender *c = trial.contenders[0];
    double time = median(c->shortest, of->sequence->problems);
    int usable = error_of(of, c) <= exact && c->failures == 0;
    clear(&trial);
    return usable ? time : INFINITY;
}

/* The fastest partial condensing, and then the fastest first barrier parameter. */
static struct choices best_choices(const struct race *r, enum mode mode, int quick)
{
    int n = r->sequence->horizon;
    struct choices best = {mode, n, MU0[0], TOLERANCES[0], 0};
    double shortest = INFINITY;
    for (size_t d = 0; d < (quick ? 3 : LENGTH(DIVISORS)); d++) {
        struct choices choices = {mode, n / DIVISORS[d], MU0[0], TOLERANCES[0], 0};
        double time = try_choices(r, choices, ROUGH);
        if (time < shortest) {
            shortest = time;
            best = choices;
        }
    }
    struct choices begun = best;
    for (size_t m = 1; m < LENGTH(MU0); m++) {
        begun.mu0 = MU0[m];
        double time = try_choices(r, begun, ROUGH);
        if (time < shortest) {
            shortest = time;
            best = begun;
        }
    }
    return best;
}

/* The same with the loosest tolerance whose answers are exact, or else uncondensed and with HPIPM's own first
 * barrier parameter; 0 where there is none. */
static int exact_choices(const struct race *r, struct choices *choices)
{
    for (int retry = 0; retry < 2; retry++) {
        if (retry) {
            choices->blocks = r->sequence->horizon;
            choices->mu0 = MU0[0];
        }
        for (size_t t = 0; t < LENGTH(TOLERANCES); t++) {
            choices->tolerance = TOLERANCES[t];
            if (isfinite(try_choices(r, *choices, EXACT)))
                return 1;
        }
    }
    return 0;
}

static void report(const struct race *r, const struct contender *c, const char *choices, FILE *out)
{
    const struct sequence *s = r->sequence;
    double error = error_of(r, c);
    fprintf(out, "%dx%d,%d,%s,%g,%.1f,%s,%s,%s,%.3f,%.3f,%.1e,%.1e,%d\n", s->nx, s->nu, s->horizon,
            s->kind, s->wanted, s->share * s->horizon * s->nu, c->name, c->variant, choices,
            1e6 * median(c->shortest, s->problems), 1e6 * worst(c->shortest, s->problems), error,
            r->residual, c->failures);
    fflush(out);
}

/* Cold, and warm in both ways. */
static void enter_all_starts(struct race *r, struct choices choices, char notes[][64])
{
    for (choices.warm_start = 0; choices.warm_start <= 2; choices.warm_start++) {
        snprintf(notes[r->count], sizeof notes[0], "blocks %d mu0 %g tolerance %g", choices.blocks,
                 choices.mu0, choices.tolerance);
        enter(r, hpipm_new(r->sequence, choices));
    }
}

/* HPIPM at its best choices of each mode, with the given tolerance and with one that makes its answers
 * exact, and our solver. */
static void bounded(const struct sequence *s, const struct options *o)
{
    struct race r = {.sequence = s};
    char notes[MOST_CONTENDERS][64] = {{0}};
    take_reference(&r, o->libraries[0], 1);
    for (int l = 0; l < o->libraries_count; l++)
        for (int warm = 0; warm < 2; warm++)
            enter(&r, own_new(o->libraries[l], s, warm, 1));
    for (int mode = MODE_SPEED_ABS; mode <= MODE_BALANCE; mode++) {
        struct choices best = best_choices(&r, mode, o->quick), exact = best;
        enter_all_starts(&r, best, notes);
        int found = exact_choices(&r, &exact);
        int other = exact.tolerance != best.tolerance || exact.blocks != best.blocks;
        if (found && (other || exact.mu0 != best.mu0))
            enter_all_starts(&r, exact, notes);
    }
    run(&r, LEAST_SWEEPS, o->seconds);
    for (int i = 0; i < r.count; i++)
        report(&r, r.contenders[i], notes[i], o->out);
    clear(&r);
    free(r.reference);
}

/* The Riccati recursion alone. */
static void unbounded(const struct sequence *s, const struct options *o)
{
    struct race r = {.sequence = s};
    take_reference(&r, o->libraries[0], 0);
    for (int l = 0; l < o->libraries_count; l++)
        enter(&r, own_new(o->libraries[l], s, 0, 0));
    for (int square_root = 0; square_root < 2; square_root++)
        enter(&r, hpipm_riccati_new(s, square_root));
    run(&r, LEAST_SWEEPS, 0.2);
    for (int i = 0; i < r.count; i++)
        report(&r, r.contenders[i], "", o->out);
    clear(&r);
    free(r.reference);
}

static void usage(void)
{
    fprintf(stderr, "driver --ours NAME=LIBRARY [--out CSV] [--seconds S] [--quick] FILE...\n");
    exit(1);
}

static int parse(int argc, char **argv, struct options *o)
{
    int i = 1;
    for (; i < argc && strncmp(argv[i], "--", 2) == 0; i++) {
        const char *value = i + 1 < argc ? argv[i + 1] : NULL;
        if (strcmp(argv[i], "--quick") == 0) {
            o->quick = 1;
            continue;
        }
        if (!value)
            usage();
        i++;
        if (strcmp(argv[i - 1], "--ours") == 0 && o->libraries_count < MOST_LIBRARIES) {
            const char *path = strchr(value, '=');
            char name[40];
            if (!path)
                usage();
            snprintf(name, sizeof name, "%.*s", (int)(path - value), value);
            o->libraries[o->libraries_count++] = library_open(name, path + 1);
        } else if (strcmp(argv[i - 1], "--out") == 0) {
            o->out = fopen(value, "w");
        } else if (strcmp(argv[i - 1], "--seconds") == 0) {
            o->seconds = atof(value);
        } else {
            usage();
        }
    }
    return i;
}

int main(int argc, char **argv)
{
    struct options o = {.out = stdout, .seconds = 0.5};
    int first = parse(argc, argv, &o);
    if (o.libraries_count == 0 || first == argc || !o.out)
        usage();
    for (int l = 0; l < o.libraries_count; l++)
        fprintf(stderr, "a call that does nothing: %.4f us\n", 1e6 * library_call(o.libraries[l]));
    fprintf(o.out, "size,horizon,kind,wanted,active,contender,variant,choices,median_us,worst_us,u0_error,"
                   "our_residual,failures\n");
    for (int i = first; i < argc; i++) {
        struct sequence s;
        if (sequence_read(argv[i], &s) || s.nu > MOST_INPUTS) {
            fprintf(stderr, "%s: no problem file\n", argv[i]);
            return 1;
        }
        if (s.wanted == 0 && strcmp(s.kind, "inputs") == 0)
            unbounded(&s, &o);
        bounded(&s, &o);
        sequence_free(&s);
        fprintf(stderr, "%s\n", argv[i]);
    }
    return 0;
}
