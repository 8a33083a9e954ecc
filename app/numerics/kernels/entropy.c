/* Twin of app.numerics.selection.GainTable: joint values, and how much they tell of a label. */
#include "kernels.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Numbers keys in the order in which they come, and counts them: open addressing. */
typedef struct {
    int64_t *key; /* -1 = free */
    int64_t *number, *count;
    ptrdiff_t size; /* a power of two, twice the rows at least */
    int64_t found;
} Tally;

static void empty(Tally *tally)
{
    memset(tally->key, 0xff, sizeof *tally->key * (size_t)tally->size);
    tally->found = 0;
}

static int64_t number_of(Tally *tally, int64_t key)
{
    uint64_t hash = (uint64_t)key * UINT64_C(0x9E3779B97F4A7C15);
    ptrdiff_t last = tally->size - 1, at = (ptrdiff_t)(hash >> 32) & last;
    while (tally->key[at] != key && tally->key[at] != -1)
        at = (at + 1) & last;
    if (tally->key[at] == -1) {
        tally->key[at] = key;
        tally->number[at] = tally->found;
        tally->count[tally->found++] = 0;
    }
    tally->count[tally->number[at]]++;
    return tally->number[at];
}

static int make_tally(Tally *tally, ptrdiff_t rows)
{
    tally->size = 16;
    while (tally->size < 2 * rows)
        tally->size *= 2;
    tally->key = malloc(sizeof *tally->key * (size_t)(3 * tally->size));
    if (tally->key == NULL)
        return OUT_OF_MEMORY;
    tally->number = tally->key + tally->size;
    tally->count = tally->number + tally->size;
    return 0;
}

static int all_under(const int64_t *values, ptrdiff_t count, ptrdiff_t end)
{
    int under = 1;
    for (ptrdiff_t i = 0; i < count; i++)
        under &= values[i] >= 0 && values[i] < end;
    return under;
}

/* Each row's joint value of `base` and `code`, as the tally numbers them. */
static void join(Tally *tally, const int64_t *base, const int64_t *code, ptrdiff_t rows,
                 int64_t *joint)
{
    empty(tally);
    for (ptrdiff_t i = 0; i < rows; i++)
        joint[i] = number_of(tally, base[i] * rows + code[i]);
}

/* Bits, times the rows, that the values counted last are short of telling every row apart. */
static double alike(const Tally *tally, const double *bits)
{
    double sum = 0.0;
    for (int64_t i = 0; i < tally->found; i++)
        sum += bits[tally->count[i]];
    return sum;
}

int join_values(const int64_t *base, const int64_t *code, ptrdiff_t rows, int64_t *joint)
{
    Tally tally;
    if (rows > MOST_COLUMNS || !all_under(base, rows, rows) || !all_under(code, rows, rows))
        return OUT_OF_BOUNDS;
    if (make_tally(&tally, rows) < 0)
        return OUT_OF_MEMORY;
    join(&tally, base, code, rows, joint);
    free(tally.key);
    return 0;
}

/* Per feature I(label; base and feature) = H(label) + H(both) - H(label, both). */
int information_gains(const int64_t *base, const int64_t *codes, const int64_t *label,
                      ptrdiff_t rows, ptrdiff_t features, double *gain_bits)
{
    Tally tally;
    if (rows > MOST_COLUMNS || !all_under(base, rows, rows) || !all_under(label, rows, rows) ||
        !all_under(codes, rows * features, rows))
        return OUT_OF_BOUNDS;
    if (make_tally(&tally, rows) < 0)
        return OUT_OF_MEMORY;
    double *bits = malloc(sizeof *bits * (size_t)(rows + 1));
    int64_t *joint = malloc(sizeof *joint * (size_t)(rows + 1));
    if (bits != NULL && joint != NULL) {
        bits[0] = 0.0;
        for (ptrdiff_t i = 1; i <= rows; i++)
            bits[i] = (double)i * log2((double)i);
        memset(joint, 0, sizeof *joint * (size_t)(rows + 1));
        join(&tally, joint, label, rows, joint);
        double of_label = alike(&tally, bits);
        for (ptrdiff_t i = 0; i < features; i++) {
            join(&tally, base, codes + i * rows, rows, joint);
            double of_both = alike(&tally, bits);
            join(&tally, joint, label, rows, joint);
            /* H = log2(rows) - alike / rows, of each */
            gain_bits[i] = rows == 0 ? 0.0
                                     : log2((double)rows) +
                                           (alike(&tally, bits) - of_label - of_both) / (double)rows;
        }
    }
    int answer = bits != NULL && joint != NULL ? 0 : OUT_OF_MEMORY;
    free(joint);
    free(bits);
    free(tally.key);
    return answer;
}
