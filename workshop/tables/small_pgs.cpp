// Projected Gauss-Seidel as game engines have it, for small_problems.py: one step of 1 / W_kk for
// each component, and the tangential part scaled back to the disk of radius mu r_N. It stops when
// the change of a sweep, as a velocity, is at most `tolerance` times ||q||; if it is `judged`, the
// error of both natural maps in double precision has to be so too. r is the guess on entry.
#include <algorithm>
#include <cmath>
#include <cstdint>

// W r + q of contact a
static void velocity(int m, int a, const double* W, const double* q, const double* r, double* u) {
  const double* row = W + static_cast<std::int64_t>(m) * 3 * a;
  double u0 = q[3 * a], u1 = q[3 * a + 1], u2 = q[3 * a + 2];
  for (int j = 0; j < m; ++j) {
    u0 += row[j] * r[j];
    u1 += row[m + j] * r[j];
    u2 += row[2 * m + j] * r[j];
  }
  u[0] = u0, u[1] = u1, u[2] = u2;
}

// ||r - P_K(r - rho u^)||^2
static double map(double mu, double rho, const double* u, const double* r) {
  const double v0 = rho * (u[0] + mu * std::sqrt(u[1] * u[1] + u[2] * u[2]));
  const double y0 = r[0] - v0, y1 = r[1] - rho * u[1], y2 = r[2] - rho * u[2];
  const double t = std::sqrt(y1 * y1 + y2 * y2);
  double p0 = y0, scale = 1;
  if (mu * t <= -y0) {
    p0 = scale = 0;
  } else if (t > mu * y0) {
    p0 = (y0 + mu * t) / (1 + mu * mu);
    scale = mu * p0 / t;
  }
  const double d0 = r[0] - p0, d1 = r[1] - scale * y1, d2 = r[2] - scale * y2;
  return d0 * d0 + d1 * d1 + d2 * d2;
}

static bool small(int nc, const double* W, const double* q, const double* mu, double tolerance,
                  const double* r) {
  const int m = 3 * nc;
  double plain = 0, impulse = 0, speed = 0, size = 0, scaled = 0;
  for (int a = 0; a < nc; ++a) {
    double trace = 0, own = 0, u[3];
    for (int k = 3 * a; k < 3 * a + 3; ++k) {
      trace += W[static_cast<std::int64_t>(m) * k + k];
      own += q[k] * q[k];
    }
    const double rho = 3 / trace;
    velocity(m, a, W, q, r, u);
    const double square = map(mu[a], rho, u, r + 3 * a);
    plain += map(mu[a], 1, u, r + 3 * a);
    impulse += square;
    speed += std::max(square / (rho * rho), u[0] < 0 ? u[0] * u[0] : 0.0);
    size += own;
    scaled += rho * rho * own;
  }
  const double most = tolerance * tolerance;
  return std::max(plain, speed) <= most * size && impulse <= most * scaled;
}

static void solve(int nc, const double* W, const double* q, const double* mu, double tolerance,
                  int most, bool judged, double* r) {
  const int m = 3 * nc;
  double bound = 0;
  for (int k = 0; k < m; ++k) bound += q[k] * q[k];
  bound *= tolerance * tolerance;
  for (int sweep = 1; sweep <= most; ++sweep) {
    double change = 0;
    for (int a = 0; a < nc; ++a) {
      double u[3];
      velocity(m, a, W, q, r, u);
      const double* row = W + static_cast<std::int64_t>(m) * 3 * a;
      const double w0 = row[3 * a];
      const double wt = std::max(row[m + 3 * a + 1], row[2 * m + 3 * a + 2]);
      const double n = std::max(0.0, r[3 * a] - u[0] / w0);
      double s = r[3 * a + 1] - u[1] / wt, t = r[3 * a + 2] - u[2] / wt;
      const double square = s * s + t * t, radius = mu[a] * n;
      if (square > radius * radius) {
        const double scale = radius / std::sqrt(square);
        s *= scale;
        t *= scale;
      }
      const double d0 = w0 * (n - r[3 * a]);
      const double d1 = wt * (s - r[3 * a + 1]), d2 = wt * (t - r[3 * a + 2]);
      change += d0 * d0 + d1 * d1 + d2 * d2;
      r[3 * a] = n, r[3 * a + 1] = s, r[3 * a + 2] = t;
    }
    if (change <= bound && (!judged || small(nc, W, q, mu, tolerance, r))) return;
  }
}

extern "C" void pgs(std::int64_t count, int nc, const double* W, const double* q, const double* mu,
                    double tolerance, int most, int judged, double* r) {
  const std::int64_t m = 3 * static_cast<std::int64_t>(nc);
  for (std::int64_t k = 0; k < count; ++k) {
    solve(nc, W + k * m * m, q + k * m, mu + k * nc, tolerance, most, judged != 0, r + k * m);
  }
}
