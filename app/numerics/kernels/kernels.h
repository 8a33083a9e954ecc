/*
 * The numeric core in C: each function is the twin of numpy code that defines it, named beside it.
 *
 * Nothing here knows of Python; module.c hands in arrays whose shapes it has checked. What arrays
 * hold is checked here, before it serves as an index.
 */
#ifndef ROADPRINT_KERNELS_H
#define ROADPRINT_KERNELS_H

#include <stddef.h>
#include <stdint.h>

enum { TERMS = 5 };                                              /* A, B, C, L, S of a cell */
enum { CHAINAGE, WIDTH, SCORE, RESIDUAL, WEIGHT, APART, VALUES };       /* rows of Places.values */
enum { X_M, Y_M, LON, LAT, HEADING, PLANE };                     /* rows of Atlas.plane */
enum { OUT_OF_MEMORY = -1, OUT_OF_BOUNDS = -2 };                 /* what the functions below answer */

#define MOST_COLUMNS 1e9 /* farther than any road: what is not below would not fit an index */

/* A window made ready: app.numerics.observation.Evidence, with what is mapped of its cells. */
typedef struct {
    ptrdiff_t samples, cells;
    const double *behind_m, *weight, *level_db, *heard, *share;
    const ptrdiff_t *numbers; /* of each cell in the profile, or of its stand-in; -1 = neither */
    const ptrdiff_t *group; /* of each cell, from 0 on: they share an offset */
    ptrdiff_t groups;
} Told;

/* A profile's rows: app.numerics.observation.Profile. */
typedef struct {
    const float *rows, *bend;
    ptrdiff_t cells, columns;
} Along;

/* A tape, BLOCK columns of a cell after the other: app.numerics.tapes.CoarseProfile. */
enum { BLOCK = 16, MERGED = 4 }; /* columns; A, B, D and S */
typedef struct {
    const float *blocks, *outside;
    ptrdiff_t cells, columns;
} Tape;

/* The constants of app.numerics.observation and a window's OffsetPrior, its variances over the
 * temperature. */
typedef struct {
    double hearing, outside_log, like_db2, like_log, any_db2, any_log, group_db2, apart, temperature;
} Likelihood;

/* Places and the map's geometry: app.numerics.posterior.Places, app.numerics.index.Atlas. */
typedef struct {
    ptrdiff_t count;
    const int64_t *road, *sign;
    const double *values; /* (VALUES, count) */
} Places;

typedef struct {
    ptrdiff_t roads, grid, edges;
    const int64_t *start, *size, *segment;
    const double *step_m, *plane; /* (PLANE, grid) */
    const double *edge_m;
    const int64_t *first_edge; /* (roads + 1) */
} Atlas;

/* How far places reach along their roads: see app.numerics.spread. */
typedef struct {
    double sd_m, reach_sds, negligible; /* mass of places that are not spread */
} Spread;

typedef struct {
    int64_t road, segment, sign;
    double mass, score, chainage_m; /* of its best place, but for the mass */
    int64_t spilled;                /* it has no place of its own: chainage of the edge next to it */
} Candidate;

/* Room grows as it fills; `each` is given back by whoever began it. */
typedef struct {
    Candidate *each;
    ptrdiff_t count, room;
} Candidates;

/* Arms of a tape's junctions: app.numerics.turns.Arms; windows end 1 to `ends` columns past them. */
typedef struct {
    ptrdiff_t count, ends;
    const int64_t *column, *sign, *onto;
} Arms;

/* Of each turn, the arms it joins and the columns of road past its junction. */
typedef struct {
    ptrdiff_t count, ends;
    const int64_t *onto, *off, *room;
} Turns;

/* Places from `first` to `end - 1`. */
typedef struct {
    ptrdiff_t first, end;
} Row;

/* Places to be filled in. */
typedef struct {
    ptrdiff_t count;
    int64_t *where;
    double *values;
} Room;

/* A window on a stretch of road: grid positions `first` to `last`. */
typedef struct {
    Told told;
    Along along;
    int64_t road, sign;
    ptrdiff_t first, last;
    double step_m, length_m;
} Laid;

/* Coarse positions along each road in order; a row of them goes on to the next within `joined_m`. */
typedef struct {
    ptrdiff_t count;
    const double *chainage_m;
    const int64_t *road, *sign;
    double step_m, joined_m;
} Coarse;

/* Which places matter: how far under the best they lie, and how much road they may be. */
typedef struct {
    double within, lightest, widest_m, reach_m, most_m;
} Heavy;

/* Factors of the travelled distance, each with the log of its share; see app.numerics.odometer.
 * After `count` that are looked at anyhow follow those of one side and then of the other, `farther`
 * each: these are, if the outermost of the others lies no more than `from` under the best. */
typedef struct {
    ptrdiff_t count, farther;
    const double *value, *log_prior;
    double temperature, from;
} Hypotheses;

/* What is drawn anew: see app.numerics.refinement. */
typedef struct {
    const double *step_m; /* of each road */
    ptrdiff_t roads;
    double lowest;
    ptrdiff_t around, least, most, parts;
} Drawing;

/* What scores are held against: app.numerics.chosen.Scale. */
typedef struct {
    double temperature, step_m, highest, aligned_m;
} Scale;

/* The law of levels along any road: app.numerics.elsewhere. */
typedef struct {
    double mean_db2, field_db2, field_m, noise_db2, reading_log;
} Field;

/* Other laws of a window's levels: app.numerics.this_road. */
typedef struct {
    double drift_db2, drift_m, much_drift_db2, much_drift_m, shadowing_db2, shadowing_m;
    double noise_times, background_log, temperature;
} Laws;

/* A place on a road: so far from grid position `low` to the next, distances so many times as long. */
typedef struct {
    ptrdiff_t low, sign;
    double share, step_m, factor;
} OnRoad;

/* evidence.c */
ptrdiff_t count_stretches(const double *distance_m, ptrdiff_t samples, double step_m);
void gather_evidence(const double *distance_m, const double *rsrp_dbm, ptrdiff_t samples,
                     ptrdiff_t width, const ptrdiff_t *columns, const ptrdiff_t *carrier,
                     ptrdiff_t cells, double step_m, double centre_dbm, double correlation_m,
                     ptrdiff_t stretches, double *block);

/* Hampel's filter: app.numerics.wild. */
typedef struct {
    ptrdiff_t neighbours, least;
    double reach_m, sure_db, times;
} Hampel;

/* How many readings are wild; only then `left_dbm` is filled in with the others. */
ptrdiff_t leave_out_wild(const double *distance_m, const double *rsrp_dbm, ptrdiff_t samples,
                         ptrdiff_t width, const Hampel *filter, double *left_dbm);

/* In place, what silence counts for; how many times the usual cells: app.numerics.listing. */
double listen_to(double *block, ptrdiff_t samples, ptrdiff_t cells, const double *usual,
                 double few, double enough, double least, double *readings);

/* elsewhere.c */
int weigh_elsewhere(const double *block, ptrdiff_t samples, ptrdiff_t cells, const Field *field,
                    double temperature, double *log_evidence);

/* this_road.c */
int weigh_this_road(const Told *told, const Along *along, const OnRoad *at, const Laws *laws,
                    const Field *field, const Likelihood *devices, double found[5]);

/* tape.c */
int score_tape(const Told *told, const Tape *tape, const int64_t *positions, ptrdiff_t count,
               double step_m, const Likelihood *likelihood, float *score, const Arms *arms,
               float *parts);

/* corners.c */
int score_turns(const float *parts, ptrdiff_t arms, ptrdiff_t channels, const Turns *turns,
                ptrdiff_t first, ptrdiff_t last, const Likelihood *likelihood, float *score);

/* stretch.c */
int lay_stretch(const Laid *laid, const Likelihood *likelihood, const Room *room, ptrdiff_t at);

/* posterior.c */
ptrdiff_t keep_by_mass(const float *score, ptrdiff_t count, double temperature, double left_out,
                       ptrdiff_t most, int64_t *kept);
ptrdiff_t keep_heaviest(const float *score, ptrdiff_t count, double temperature, double left_out,
                        double not_looked_at, ptrdiff_t most, int64_t *kept, int *whole,
                        double *total);
void share_mass(const Places *places, double temperature, double *mass);
int find_summit(const Places *places, const double *mass, ptrdiff_t roads, double near_m, double foot,
                ptrdiff_t *road, double *road_mass, ptrdiff_t *peak, double *chainage_m);

/* chosen.c */
ptrdiff_t add_neighbours(const int64_t *number, ptrdiff_t places, const int64_t *rows,
                         const int64_t *here, ptrdiff_t count, ptrdiff_t scores, int64_t *with);
ptrdiff_t join_coarse(const Coarse *kept, const double *step_m, const int64_t *size,
                      ptrdiff_t roads, Laid *found);

/* rest.c */
ptrdiff_t sum_rest(const float *score, ptrdiff_t count, const int64_t *starts, ptrdiff_t runs,
                   const int64_t *covered, ptrdiff_t many, const Scale *scale, double left_out,
                   int64_t *best, double *width_m);

/* refinement.c */
ptrdiff_t find_rows(const Places *places, const double *step_m, ptrdiff_t roads, double lowest,
                    ptrdiff_t around, ptrdiff_t least, ptrdiff_t most, Row *rows);
int draw_row(const Told *told, const Along *along, const Places *places, ptrdiff_t first,
             ptrdiff_t end, ptrdiff_t parts, double step_m, double like_db2, double *values,
             ptrdiff_t stride);
void copy_places(const Places *places, ptrdiff_t first, ptrdiff_t end, const Room *room,
                 ptrdiff_t at);
int redraw(const Told *told, const Along *along, const Places *places, ptrdiff_t first,
           ptrdiff_t end, ptrdiff_t parts, double step_m, double like_db2, const Room *room);

/* odometer.c */
ptrdiff_t stretches_about(const Places *places, const double *step_m, const int64_t *size,
                          ptrdiff_t roads, const Heavy *heavy, double *width_m, Laid *found);
ptrdiff_t lay_factors(const Laid *stretches, ptrdiff_t count, const Hypotheses *factors,
                      const Likelihood *likelihood, const Drawing *drawing, const Places *before,
                      ptrdiff_t straight, Room *room, double *log_prior, double *factor,
                      double *together);

/* spread.c */
int list_runs(const Places *places, const double *mass, const Atlas *atlas, const Spread *spread,
              Candidates *runs);

/* candidates.c */
int list_candidates(const Places *places, const double *mass, const Atlas *atlas,
                    const Spread *spread, Candidates *listed);

/* entropy.c */
int join_values(const int64_t *base, const int64_t *code, ptrdiff_t rows, int64_t *joint);
int information_gains(const int64_t *base, const int64_t *codes, const int64_t *label,
                      ptrdiff_t rows, ptrdiff_t features, double *gain_bits);

/* geometry.c */
ptrdiff_t spot(const Atlas *atlas, int64_t road, double chainage_m, double *share);
double between(const Atlas *atlas, int row, ptrdiff_t low, double share);
int radius(const Places *places, const double *mass, const Atlas *atlas, double x_m, double y_m,
           double confidence, double position_sd_m, double negligible, double *radius_m);

#endif
