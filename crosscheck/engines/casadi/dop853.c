/* DOP853 around generated rates, compiled with them into one piece: N numbers of a state, tableau and step control
   as in crosscheck/engines/shared/compiled/dop853.py.  Included after RATES, SETTLE, STAGES, A, B, C, E3, E5. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#define SAFETY 0.8
#define SHRINK 0.2
#define GROW 100.0
#define RETRY 0.25
#define JUMPS 16
#define LONGEST_JUMP 4.0
enum { REACHED, NOT_FINITE, TOO_SMALL, TOO_MANY };

static double largest(double a, double b) { return a > b ? a : b; }

static int all_finite(const double *y) {
  double sum = 0.0;
  for (int i = 0; i < N; i++) sum += y[i];
  return isfinite(sum);
}

static double growth(double ratio) {
  if (!(ratio >= 0.0)) return RETRY;
  if (ratio == 0.0) return GROW;
  double factor = SAFETY * pow(ratio, -0.125);
  return factor < SHRINK ? SHRINK : factor > GROW ? GROW : factor;
}

/* the factor, 1 at most, by which the trend of errors shortens the step after one of length h */
static double trend(double h, double ratio, double *last) {
  double length = last[0], before = last[1];
  last[0] = h, last[1] = ratio;
  if (!(ratio > 0.0 && before > 0.0)) return 1.0;
  double factor = h / length * pow(before / ratio, 0.125);
  return factor < SHRINK ? SHRINK : factor < 1.0 ? factor : 1.0;
}

/* the new state of a step; its error over the tolerance, or -1 */
static double attempt(double h, double rtol, int settles, const double *y, double slopes[STAGES][N], double *new) {
  for (int s = 1; s < STAGES; s++) {
    for (int i = 0; i < N; i++) new[i] = 0.0;
    for (int r = 0; r < s; r++)
      if (A[s][r] != 0.0)
        for (int i = 0; i < N; i++) new[i] += A[s][r] * slopes[r][i];
    for (int i = 0; i < N; i++) new[i] = y[i] + h * new[i];
    RATES(new, slopes[s]);
  }
  double third = 0.0, fifth = 0.0;
  for (int i = 0; i < N; i++) {
    double step = 0.0, e3 = 0.0, e5 = 0.0;
    for (int s = 0; s < STAGES; s++) {
      step += B[s] * slopes[s][i];
      e3 += E3[s] * slopes[s][i];
      e5 += E5[s] * slopes[s][i];
    }
    new[i] = y[i] + h * step;
    double scale = rtol + rtol * largest(fabs(y[i]), fabs(new[i]));
    third = largest(third, fabs(e3) / scale);
    fifth = largest(fifth, fabs(e5) / scale);
  }
  if (!all_finite(new)) return -1.0;
  if (settles) SETTLE(new);
  if (!all_finite(new)) return -1.0;
  return fifth > 0.0 ? h * fifth * fifth / sqrt(fifth * fifth + 0.01 * third * third) : 0.0;
}

static double first_step(double rtol, double end, const double *y, const double *rate) {
  double size = 0.0, speed = 0.0;
  for (int i = 0; i < N; i++) {
    double scale = rtol + rtol * fabs(y[i]);
    size = largest(size, fabs(y[i]) / scale);
    speed = largest(speed, fabs(rate[i]) / scale);
  }
  return size > 1e-5 && speed > 1e-5 ? 0.01 * size / speed : 1e-6 * end;
}

/* the step, of the shortest and some longer ones, whose error is the least; 0 where all fail */
static double jump(double left, double shortest, double rtol, int settles, const double *y, double slopes[STAGES][N],
                   double *new) {
  double best = 0.0, least = INFINITY;
  for (int k = 0; k < JUMPS; k++) {
    double h = shortest * (1.0 + (LONGEST_JUMP - 1.0) * k / (JUMPS - 1));
    if (h > left) h = left;
    double ratio = attempt(h, rtol, settles, y, slopes, new);
    if (ratio >= 0.0 && ratio < least) best = h, least = ratio;
  }
  if (best > 0.0) attempt(best, rtol, settles, y, slopes, new);
  return best;
}

/* States at the times into samples (count, N); counts are steps, rejected steps, evaluations and samples;
   the last step begins or ends at reached. */
int integrate(const double *start, const double *times, int64_t count, double rtol, double shortest, int settles,
              double *samples, int64_t *counts, double *reached) {
  double y[N], new[N], slopes[STAGES][N], last[2] = {0.0, 0.0}, t = 0.0, next = 0.0,
         end = times[count - 1];
  memcpy(y, start, sizeof y);
  memset(counts, 0, 4 * sizeof *counts);
  for (int64_t k = 0; k < count; k++) {
    while (t < times[k]) {
      *reached = t;
      if (++counts[0] > 1000000) return TOO_MANY;
      RATES(y, slopes[0]);
      counts[2]++;
      if (!all_finite(slopes[0])) return NOT_FINITE;
      if (next == 0.0) next = first_step(rtol, end, y, slopes[0]);
      for (;;) {
        double left = times[k] - t, wanted = largest(next, shortest), h = wanted;
        if (h * (1.0 + 1e-9) >= left) h = left;
        else if (h > 0.5 * left) h = 0.5 * left;
        double ratio = attempt(h, rtol, settles, y, slopes, new);
        counts[2] += STAGES - 1;
        if (ratio >= 0.0 && ratio <= 1.0) {
          double grown = h * growth(ratio) * trend(h, ratio, last);
          next = h < wanted ? largest(grown, next) : grown;
          t = h == left ? times[k] : t + h;
          break;
        }
        counts[1]++;
        double factor = growth(ratio);
        next = h * (factor < 1.0 ? factor : 1.0);
        if (h <= shortest * (1.0 + 1e-9)) {
          h = jump(left, shortest, rtol, settles, y, slopes, new);
          counts[2] += (JUMPS + 1) * (STAGES - 1);
          if (h == 0.0) return NOT_FINITE;
          last[1] = 0.0;
          t = h == left ? times[k] : t + h;
          break;
        }
        if (!(next > 1e-14 * end)) return TOO_SMALL;
      }
      memcpy(y, new, sizeof y);
    }
    memcpy(samples + k * N, y, sizeof y);
    counts[3]++;
  }
  *reached = t;
  return REACHED;
}
