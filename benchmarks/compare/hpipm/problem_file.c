#include "problem_file.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void stage_lengths(const struct sequence *s, size_t lengths[STAGE_PARTS])
{
    size_t nx = s->nx, nu = s->nu, rows = s->rows;
    size_t all[STAGE_PARTS] = {nx * nx, nx * nu, nx, nx * nx, nu * nu, nu * nx, nx, nu,
                               nx, nx, nx, nx, nu, nu,
                               rows * nx, rows * nu, rows, rows, rows, rows};
    memcpy(lengths, all, sizeof all);
}

static void end_lengths(const struct sequence *s, size_t lengths[END_PARTS])
{
    size_t nx = s->nx, rows = s->rows;
    size_t all[END_PARTS] = {nx * nx, nx, nx, nx, nx, nx, rows * nx, rows, rows, rows, rows};
    memcpy(lengths, all, sizeof all);
}

static size_t sum(const size_t *lengths, int parts)
{
    size_t total = 0;
    for (int part = 0; part < parts; part++)
        total += lengths[part];
    return total;
}

static size_t of_stage(const struct sequence *s)
{
    size_t lengths[STAGE_PARTS];
    stage_lengths(s, lengths);
    return sum(lengths, STAGE_PARTS);
}

int sequence_read(const char *path, struct sequence *s)
{
    memset(s, 0, sizeof *s);
    FILE *file = fopen(path, "rb");
    if (!file)
        return 1;
    char line[512];
    int found = 0;
    if (fgets(line, sizeof line, file))
        found = sscanf(line,
                       "lpvmpc-problems 1 nx %d nu %d horizon %d rows %d common %d problems %d kind %31s "
                       "wanted %lf share %lf",
                       &s->nx, &s->nu, &s->horizon, &s->rows, &s->common, &s->problems, s->kind,
                       &s->wanted, &s->share);
    int failed = found != 9;
    if (!failed) {
        size_t end[END_PARTS];
        end_lengths(s, end);
        s->of_problem = s->nx + s->horizon * of_stage(s) + sum(end, END_PARTS);
        size_t count = s->of_problem * s->problems;
        s->numbers = malloc(count * sizeof(double));
        failed = !s->numbers || fread(s->numbers, sizeof(double), count, file) != count;
    }
    fclose(file);
    return failed;
}

void sequence_free(struct sequence *s)
{
    free(s->numbers);
}

const double *sequence_problem(const struct sequence *s, int problem)
{
    return s->numbers + problem * s->of_problem;
}

const double *sequence_part(const struct sequence *s, int problem, int stage, int part)
{
    size_t stage_part_lengths[STAGE_PARTS], end_part_lengths[END_PARTS];
    stage_lengths(s, stage_part_lengths);
    end_lengths(s, end_part_lengths);
    const size_t *lengths = stage < s->horizon ? stage_part_lengths : end_part_lengths;
    return sequence_problem(s, problem) + s->nx + stage * of_stage(s) + sum(lengths, part);
}
