/* What is timed: something that solves the problems of a sequence, one after the other. */
#ifndef CONTENDER_H
#define CONTENDER_H

#include "problem_file.h"

struct contender {
    char name[48];
    char variant[64];
    void *self;
    /* Solves a problem; problem 0 begins the sequence anew. This alone is timed. */
    void (*solve)(void *self, int problem);
    /* u_0 of the last answer; 0 where that is an answer. */
    int (*first_input)(void *self, double *u0);
    void (*free)(void *self);
    /* Filled in by the race, one number per problem: shortest time [s] and first input. */
    double *shortest;
    double *u0;
    int failures;
};

/* Our solver, by its C interface. */
struct library;
struct library *library_open(const char *name, const char *path);
/* Cold or warm (from the last answer, one stage earlier); without bounds where `bounded` is 0. */
struct contender *own_new(struct library *library, const struct sequence *s, int warm, int bounded);
/* Largest residual of the optimality conditions at, and active bounds of, the last answer, which is
 * that of `problem`. */
void own_answer(const struct contender *c, int problem, double *residual, int *active);
/* Seconds that a call takes that does nothing. */
double library_call(const struct library *library);

/* HPIPM. */
enum mode { MODE_SPEED_ABS, MODE_BALANCE };
struct choices {
    enum mode mode;
    int blocks;     /* stages after partial condensing; the horizon: no condensing */
    double mu0;     /* first value of the barrier parameter */
    double tolerance;
    int warm_start; /* 0 none, 1 primal, 2 primal and dual: from the last answer as it is */
};
struct contender *hpipm_new(const struct sequence *s, struct choices choices);
/* Iterations of the last answer. */
int hpipm_iterations(const struct contender *c);
/* The Riccati recursion of HPIPM without bounds; `square_root`: its square-root form. */
struct contender *hpipm_riccati_new(const struct sequence *s, int square_root);

void contender_free(struct contender *c);

#endif
