/* Problem files (../../problems/README.md) in memory. */
#ifndef PROBLEM_FILE_H
#define PROBLEM_FILE_H

#include <stddef.h>

/* Parts of a stage's block and of that of the end, in the order of the file. */
enum stage_part {
    PART_A, PART_B, PART_C, PART_Q, PART_R, PART_S, PART_LINEAR_X, PART_LINEAR_U,
    PART_X_LOWER, PART_X_UPPER, PART_X_LINEAR, PART_X_QUADRATIC, PART_U_LOWER, PART_U_UPPER,
    PART_ROWS_X, PART_ROWS_U, PART_ROWS_LOWER, PART_ROWS_UPPER, PART_ROWS_LINEAR, PART_ROWS_QUADRATIC,
    STAGE_PARTS
};
enum end_part {
    END_P, END_LINEAR_X, END_X_LOWER, END_X_UPPER, END_X_LINEAR, END_X_QUADRATIC,
    END_ROWS_X, END_ROWS_LOWER, END_ROWS_UPPER, END_ROWS_LINEAR, END_ROWS_QUADRATIC,
    END_PARTS
};

struct sequence {
    int nx, nu, horizon, rows, common, problems;
    char kind[32];
    double wanted, share;
    size_t of_problem; /* numbers of a problem */
    double *numbers;
};

/* 0 where it succeeds. */
int sequence_read(const char *path, struct sequence *sequence);
void sequence_free(struct sequence *sequence);

const double *sequence_problem(const struct sequence *sequence, int problem);
/* A part of a stage, or of the end where `stage` is the horizon and `part` an end_part. */
const double *sequence_part(const struct sequence *sequence, int problem, int stage, int part);

#endif
