#include "embed/derivatives.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <limits>
#include <mutex>
#include <numeric>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "deadline.hpp"
#include "embed/memory.hpp"
#include "error.hpp"
#include "linalg/workers.hpp"

namespace fclib {

namespace {

/// The number of problems that a thread takes at once.
constexpr std::int64_t chunk = 32;
constexpr double poll_interval = 0.1;  // [s]
// as in fclib/_derivatives.py, and for the same reasons
/// Relative to the largest z: a z nearer to a border than this counts as on it.
constexpr double border = 1e-6;
/// Pivots below this, relative to the largest, are zero.
constexpr double rank = 1e-10;
constexpr double nothing = std::numeric_limits<double>::quiet_NaN();

/// S = P^T L D U Q^T with complete pivoting, and solutions with its pseudo-inverse.
class PivotedFactors {
 public:
  /// S (n x n, by rows) is overwritten.
  void factorise(std::vector<double>& s, std::size_t n);
  [[nodiscard]] bool regular() const { return k_ == n_; }

  /// x = S^+ x, or with the transpose of S.
  void solve(bool transposed, double* x);

 private:
  /// Finds the least y with T y = x, for the k x n rows of ones and numbers behind them: the U, or
  /// the transpose of L. And the y with the least ||T^T y - x||.
  struct Trapeze {
    const double* at;
    std::size_t row;     // from one row to the next
    std::size_t column;  // from one column to the next
    [[nodiscard]] double operator()(std::size_t i, std::size_t j) const {
      return i == j ? 1.0 : at[row * i + column * j];
    }
  };
  void least_norm(const Trapeze& t, const std::vector<double>& gram, double* x) const;
  void least_squares(const Trapeze& t, const std::vector<double>& gram, double* x) const;
  void cholesky(const Trapeze& t, std::vector<double>& gram) const;
  void cholesky_solve(const std::vector<double>& gram, double* x) const;

  std::size_t n_ = 0;
  std::size_t k_ = 0;  // the rank
  const double* lu_ = nullptr;
  std::vector<double> pivot_, y_, left_gram_, right_gram_;
  std::vector<std::size_t> rows_, columns_;
};

void PivotedFactors::factorise(std::vector<double>& s, std::size_t n) {
  n_ = n;
  for (auto* places : {&rows_, &columns_}) {
    grow(*places, n);
    std::iota(places->begin(), places->begin() + static_cast<std::ptrdiff_t>(n), std::size_t{0});
  }
  grow(pivot_, n);
  grow(y_, n);
  double* const a = s.data();
  lu_ = a;
  // the largest entry is found while the last step changes the entries
  std::size_t row = 0;
  std::size_t col = 0;
  double largest = -1;
  const auto see = [&](std::size_t i, std::size_t j, double value) {
    if (std::abs(value) > largest) {
      largest = std::abs(value);
      row = i;
      col = j;
    }
  };
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) see(i, j, a[n * i + j]);
  }
  const double least = rank * std::max(largest, 0.0);
  for (k_ = 0; k_ < n; ++k_) {
    if (!(largest > least)) break;
    if (row != k_) {
      std::swap_ranges(a + n * k_, a + n * k_ + n, a + n * row);
      std::swap(rows_[k_], rows_[row]);
    }
    if (col != k_) {
      for (std::size_t i = 0; i < n; ++i) std::swap(a[n * i + k_], a[n * i + col]);
      std::swap(columns_[k_], columns_[col]);
    }
    double* __restrict const from = a + n * k_;
    const double pivot = from[k_];
    pivot_[k_] = pivot;
    for (std::size_t j = k_ + 1; j < n; ++j) from[j] /= pivot;  // U has ones on its diagonal
    largest = -1;
    for (std::size_t i = k_ + 1; i < n; ++i) {
      double* __restrict const to = a + n * i;
      const double entry = to[k_];
      to[k_] = entry / pivot;
      if (entry != 0) {
        for (std::size_t j = k_ + 1; j < n; ++j) to[j] -= entry * from[j];
      }
      double most = 0;
      for (std::size_t j = k_ + 1; j < n; ++j) most = std::max(most, std::abs(to[j]));
      if (most > largest) {
        largest = most;
        row = i;
      }
    }
    if (k_ + 1 < n) {
      const double* const at = a + n * row;
      col = k_ + 1;
      while (std::abs(at[col]) != largest && col + 1 < n) ++col;
    }
  }
  if (regular()) return;
  cholesky({lu_, n_, 1}, right_gram_);  // U U^T
  cholesky({lu_, 1, n_}, left_gram_);   // L^T L
}

/// The factor of T T^T (k x k).
void PivotedFactors::cholesky(const Trapeze& t, std::vector<double>& gram) const {
  grow(gram, k_ * k_);
  for (std::size_t i = 0; i < k_; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      double sum = 0;
      for (std::size_t l = i; l < n_; ++l) sum += t(i, l) * t(j, l);
      for (std::size_t l = 0; l < j; ++l) sum -= gram[k_ * i + l] * gram[k_ * j + l];
      gram[k_ * i + j] = i == j ? std::sqrt(sum) : sum / gram[k_ * j + j];
    }
  }
}

void PivotedFactors::cholesky_solve(const std::vector<double>& gram, double* x) const {
  for (std::size_t i = 0; i < k_; ++i) {
    for (std::size_t j = 0; j < i; ++j) x[i] -= gram[k_ * i + j] * x[j];
    x[i] /= gram[k_ * i + i];
  }
  for (std::size_t i = k_; i-- > 0;) {
    for (std::size_t j = i + 1; j < k_; ++j) x[i] -= gram[k_ * j + i] * x[j];
    x[i] /= gram[k_ * i + i];
  }
}

/// x (k, then n numbers) becomes the least solution of T y = x.
void PivotedFactors::least_norm(const Trapeze& t, const std::vector<double>& gram,
                                double* x) const {
  if (regular()) {
    for (std::size_t i = n_; i-- > 0;) {
      for (std::size_t j = i + 1; j < n_; ++j) x[i] -= t(i, j) * x[j];
    }
    return;
  }
  cholesky_solve(gram, x);
  for (std::size_t j = n_; j-- > 0;) {
    double sum = 0;
    for (std::size_t i = 0; i < std::min(j + 1, k_); ++i) sum += t(i, j) * x[i];
    x[j] = sum;  // x[i] for i < j are still to be used, those behind are not
  }
}

/// x (n numbers) becomes the y (k) with the least ||T^T y - x||.
void PivotedFactors::least_squares(const Trapeze& t, const std::vector<double>& gram,
                                   double* x) const {
  if (regular()) {
    for (std::size_t i = 0; i < n_; ++i) {
      for (std::size_t j = 0; j < i; ++j) x[i] -= t(j, i) * x[j];
    }
    return;
  }
  for (std::size_t i = 0; i < k_; ++i) {
    double sum = 0;
    for (std::size_t j = i; j < n_; ++j) sum += t(i, j) * x[j];
    x[i] = sum;  // x[j] for j > i are still to be used, those before are not
  }
  cholesky_solve(gram, x);
}

void PivotedFactors::solve(bool transposed, double* x) {
  if (n_ == 0) return;
  const Trapeze u{lu_, n_, 1};
  const Trapeze lt{lu_, 1, n_};
  const auto& in = transposed ? columns_ : rows_;
  const auto& out = transposed ? rows_ : columns_;
  for (std::size_t i = 0; i < n_; ++i) y_[i] = x[in[i]];
  if (transposed) {
    least_squares(u, right_gram_, y_.data());
  } else {
    least_squares(lt, left_gram_, y_.data());
  }
  for (std::size_t i = 0; i < k_; ++i) y_[i] /= pivot_[i];
  if (transposed) {
    least_norm(lt, left_gram_, y_.data());
  } else {
    least_norm(u, right_gram_, y_.data());
  }
  for (std::size_t i = 0; i < n_; ++i) x[out[i]] = y_[i];
}

/// Coulomb's law at a solution.
enum class Law : std::uint8_t { open, stick, slide };

struct Status {
  Law law;
  bool degenerate;  // on a border between two of them
  double sliding;   // ||z_T||, z = r - rho u
  double speed;     // ||u_T||
};

/// Of a contact; `longest` is the largest ||z|| of the problem.
template <int D>
Status status_of(const double* z, const double* u, double mu, double longest) {
  double sliding = 0;
  double speed = 0;
  for (int k = 1; k < D; ++k) {
    sliding += z[k] * z[k];
    speed += u[k] * u[k];
  }
  sliding = std::sqrt(sliding);
  speed = std::sqrt(speed);
  const double excess = sliding - mu * z[0];
  const bool open = z[0] <= 0;
  const bool slides = excess > 0 || mu == 0;
  const bool degenerate =
      std::abs(z[0]) <= border * longest || (!open && std::abs(excess) <= border * longest);
  return {open ? Law::open : slides ? Law::slide : Law::stick, degenerate, sliding, speed};
}

/// The mean of the diagonal of a contact's block; rows are m entries long.
template <int D>
double size_of(const double* block, std::size_t m) {
  double size = 0;
  for (std::size_t k = 0; k < D; ++k) size += block[(m + 1) * k] / D;
  return size;
}

/// A problem of one contact that has a well-conditioned S: dr = G (dq + dW r) + h dmu, and G and h
/// follow from the law in closed form.
template <int D>
class OneContact {
 public:
  /// Returns false if the problem is for Point: the data may not be valid, or S be singular.
  bool take(const double* W, const double* q, const double* mu, const double* r);

  [[nodiscard]] static bool unique() { return true; }
  [[nodiscard]] bool degenerate(std::int64_t) const { return degenerate_; }

  void adjoint(const double* by_r, const double* by_u, double* by_W, double* by_q,
               double* by_mu) const;
  void forward(const double* dW, const double* dq, const double* dmu, double* dr, double* du) const;
  void sensitivities(double* by_q, double* by_mu) const;

 private:
  /// S is well conditioned if its determinant is at least this part of its columns' lengths. This
  /// only says which of two ways is taken, as far as both have digits enough: a test solves the
  /// same contacts beside another one, which is Point's way, and the derivatives agree.
  static constexpr double well_conditioned = 1e-3;

  bool stick(double rho);
  bool slide(double rho, double mu, const Status& status, const double* z);

  const double* W_ = nullptr;
  const double* r_ = nullptr;
  bool degenerate_ = false;
  double G_[D][D];
  double h_[D];
};

template <int D>
bool OneContact<D>::take(const double* W, const double* q, const double* mu, const double* r) {
  W_ = W;
  r_ = r;
  double u[D];
  double z[D];
  double sum = *mu * 0.0;  // zero, or NaN; what is not finite in W, q or r is so in u
  for (int i = 0; i < D; ++i) {
    u[i] = q[i];
    for (int j = 0; j < D; ++j) u[i] += W[D * i + j] * r[j];
    sum += u[i] * 0.0;
  }
  const double size = size_of<D>(W, D);
  if (sum != 0 || !(*mu >= 0) || !(size > 0)) return false;
  const double rho = 1 / size;
  double square = 0;
  for (int i = 0; i < D; ++i) {
    z[i] = r[i] - rho * u[i];
    square += z[i] * z[i];
  }
  const Status status = status_of<D>(z, u, *mu, std::sqrt(square));
  degenerate_ = status.degenerate;
  if (status.law == Law::slide) {
    // near the border to stick the rows are scaled
    return !status.degenerate && slide(rho, *mu, status, z);
  }
  for (int i = 0; i < D; ++i) {
    h_[i] = 0;
    for (int j = 0; j < D; ++j) G_[i][j] = 0;
  }
  return status.law == Law::open || stick(rho);
}

/// du = 0: G = -W^-1, by the cofactors of S = rho W.
template <int D>
bool OneContact<D>::stick(double rho) {
  double S[D][D];
  double lengths = 1;  // squared
  for (int j = 0; j < D; ++j) {
    double square = 0;
    for (int i = 0; i < D; ++i) {
      S[i][j] = rho * W_[D * i + j];
      square += S[i][j] * S[i][j];
    }
    lengths *= square;
  }
  if constexpr (D == 2) {
    G_[0][0] = S[1][1];
    G_[0][1] = -S[0][1];
    G_[1][0] = -S[1][0];
    G_[1][1] = S[0][0];
  } else {
    for (int i = 0; i < 3; ++i) {
      const int i1 = (i + 1) % 3;
      const int i2 = (i + 2) % 3;
      for (int j = 0; j < 3; ++j) {
        const int j1 = (j + 1) % 3;
        const int j2 = (j + 2) % 3;
        G_[j][i] = S[i1][j1] * S[i2][j2] - S[i1][j2] * S[i2][j1];
      }
    }
  }
  double determinant = 0;
  for (int j = 0; j < D; ++j) determinant += S[0][j] * G_[j][0];
  if (!(determinant * determinant > well_conditioned * well_conditioned * lengths)) return false;
  const double scale = -rho / determinant;
  for (auto& row : G_) {
    for (double& entry : row) entry *= scale;
  }
  return true;
}

/// With the unit vectors n, t of sliding and s across it, dr = a (n - mu t) + b s - r_N t dmu, and
///
///   rho du_N = 0,   b + c du_s = 0,   c = mu r_N / ||u_T||
///
/// are equations for a and b, K (a, b) = (-rho x_N, -c x_s), where x is du at a = b = 0. Without a
/// speed c is not finite, and no comparison holds.
template <int D>
bool OneContact<D>::slide(double rho, double mu, const Status& status, const double* z) {
  const double* const W = W_;
  double t[D]{};
  for (int i = 1; i < D; ++i) t[i] = -z[i] / status.sliding;
  double Wt[D];
  for (int i = 0; i < D; ++i) {
    Wt[i] = W[D * i + 1] * t[1];
    if constexpr (D == 3) Wt[i] += W[D * i + 2] * t[2];
  }
  const double K_aa = rho * (W[0] - mu * Wt[0]);
  // the square of the length of a column of S
  double by_n = rho * W[0] * rho * W[0] + mu * mu;
  double by_t = rho * Wt[0] * rho * Wt[0] + 1;
  if constexpr (D == 2) {
    if (!(K_aa * K_aa > well_conditioned * well_conditioned * by_n * by_t)) return false;
    G_[0][0] = -rho / K_aa;
    G_[0][1] = G_[1][1] = 0;
    G_[1][0] = -mu * t[1] * G_[0][0];
  } else {
    const double s[] = {0, -t[2], t[1]};
    const double c = mu * std::max(r_[0], 0.0) / status.speed;
    double Ws[3];
    for (int i = 0; i < 3; ++i) Ws[i] = W[3 * i + 1] * s[1] + W[3 * i + 2] * s[2];
    const double sWn = W[3] * s[1] + W[6] * s[2];
    const double sWt = Wt[1] * s[1] + Wt[2] * s[2];
    const double K_ab = rho * Ws[0];
    const double K_ba = c * (sWn - mu * sWt);
    const double K_bb = 1 + c * (Ws[1] * s[1] + Ws[2] * s[2]);
    const double determinant = K_aa * K_bb - K_ab * K_ba;
    by_n += c * sWn * c * sWn;
    // of both tangents, the mean: the columns along the axes are not longer together
    by_t = (by_t + c * sWt * c * sWt + K_ab * K_ab + K_bb * K_bb) / 2;
    if (!(determinant * determinant > well_conditioned * well_conditioned * by_n * by_t * by_t))
      return false;
    const double inverse = 1 / determinant;
    const double a_n = -K_bb * rho * inverse;
    const double a_s = K_ab * c * inverse;
    const double b_n = K_ba * rho * inverse;
    const double b_s = -K_aa * c * inverse;
    G_[0][0] = a_n;
    for (int j = 1; j < 3; ++j) G_[0][j] = a_s * s[j];
    for (int i = 1; i < 3; ++i) {
      G_[i][0] = b_n * s[i] - a_n * mu * t[i];
      const double across = b_s * s[i] - a_s * mu * t[i];
      for (int j = 1; j < 3; ++j) G_[i][j] = across * s[j];
    }
  }
  for (int i = 0; i < D; ++i) {
    double sum = t[i];
    for (int j = 0; j < D; ++j) sum += G_[i][j] * Wt[j];
    h_[i] = -r_[0] * sum;
  }
  return true;
}

template <int D>
void OneContact<D>::adjoint(const double* by_r, const double* by_u, double* by_W, double* by_q,
                            double* by_mu) const {
  double x[D];
  double change[D];
  for (int i = 0; i < D; ++i) {
    x[i] = by_r != nullptr ? by_r[i] : 0.0;
    change[i] = by_u != nullptr ? by_u[i] : 0.0;
    for (int j = 0; j < D && by_u != nullptr; ++j) x[i] += W_[D * j + i] * by_u[j];
  }
  double sum = 0;
  for (int i = 0; i < D; ++i) {
    for (int j = 0; j < D; ++j) change[j] += G_[i][j] * x[i];
    sum += h_[i] * x[i];
  }
  if (by_q != nullptr) std::copy_n(change, D, by_q);
  if (by_mu != nullptr) *by_mu = sum;
  if (by_W == nullptr) return;
  for (int i = 0; i < D; ++i) {
    for (int j = 0; j < D; ++j) by_W[D * i + j] = change[i] * r_[j];
  }
}

template <int D>
void OneContact<D>::forward(const double* dW, const double* dq, const double* dmu, double* dr,
                            double* du) const {
  double x[D];
  double y[D];  // the change of u at the same reactions
  for (int i = 0; i < D; ++i) {
    y[i] = dq != nullptr ? dq[i] : 0.0;
    for (int j = 0; j < D && dW != nullptr; ++j) y[i] += dW[D * i + j] * r_[j];
  }
  for (int i = 0; i < D; ++i) {
    x[i] = dmu != nullptr ? h_[i] * *dmu : 0.0;
    for (int j = 0; j < D; ++j) x[i] += G_[i][j] * y[j];
  }
  if (dr != nullptr) std::copy_n(x, D, dr);
  if (du == nullptr) return;
  for (int i = 0; i < D; ++i) {
    du[i] = y[i];
    for (int j = 0; j < D; ++j) du[i] += W_[D * i + j] * x[j];
  }
}

template <int D>
void OneContact<D>::sensitivities(double* by_q, double* by_mu) const {
  if (by_q != nullptr) std::copy_n(&G_[0][0], D * D, by_q);
  if (by_mu != nullptr) std::copy_n(h_, D, by_mu);
}

/// One problem at its solution.
template <int D>
class Point {
 public:
  /// Returns false if something is not a number.
  bool take(std::int64_t nc, const double* W, const double* q, const double* mu, const double* r);

  [[nodiscard]] bool unique() const { return factors_.regular(); }
  [[nodiscard]] bool degenerate(std::int64_t a) const {
    return degenerate_[static_cast<std::size_t>(a)] != 0;
  }

  void adjoint(const double* by_r, const double* by_u, double* by_W, double* by_q, double* by_mu);
  void forward(const double* dW, const double* dq, const double* dmu, double* dr, double* du);
  void sensitivities(double* by_q, double* by_mu);

 private:
  /// y = A x or A^T x of contact a; A is the law's matrix before du.
  void by_velocity(std::size_t a, bool transposed, const double* x, double* y) const {
    const double* const block = &A_[D * D * a];
    for (int i = 0; i < D; ++i) {
      double sum = 0;
      for (int j = 0; j < D; ++j) sum += block[transposed ? D * j + i : D * i + j] * x[j];
      y[i] = sum;
    }
  }
  /// x, of the contacts that are not open, with the scaled factors.
  void solve(bool transposed, double* x);

  std::int64_t nc_ = 0;
  std::size_t m_ = 0;
  const double* W_ = nullptr;
  const double* r_ = nullptr;
  std::vector<Law> law_;
  std::vector<char> degenerate_;
  std::vector<double> u_, rho_, z_;
  std::vector<double> A_, B_;  // (D x D) of each contact
  std::vector<double> by_mu_;  // (D) of each contact
  std::vector<std::size_t> kept_;
  std::vector<double> rows_, columns_, system_, whole_, x_, y_;
  PivotedFactors factors_;
};

template <int D>
bool Point<D>::take(std::int64_t nc, const double* W, const double* q, const double* mu,
                    const double* r) {
  nc_ = nc;
  const auto count = static_cast<std::size_t>(nc);
  const std::size_t m = D * count;
  m_ = m;
  W_ = W;
  r_ = r;
  for (auto* vector : {&u_, &z_, &rows_, &columns_, &x_, &y_, &by_mu_}) grow(*vector, m);
  grow(rho_, count);
  grow(law_, count);
  grow(degenerate_, count);
  grow(A_, D * D * count);
  grow(B_, D * D * count);
  double sum = 0;  // zero, or NaN
  for (std::size_t i = 0; i < m; ++i) {
    double u = q[i];
    const double* const row = W + m * i;
    for (std::size_t j = 0; j < m; ++j) {
      u += row[j] * r[j];
      sum += row[j] * 0.0;
    }
    u_[i] = u;
    sum += u * 0.0 + r[i] * 0.0;
  }
  for (std::size_t a = 0; a < count; ++a) {
    sum += mu[a] * 0.0;
    if (mu[a] < 0) return false;
  }
  if (sum != 0) return false;

  // the statuses
  double most = 0;
  for (std::size_t a = 0; a < count; ++a) {
    rho_[a] = size_of<D>(W + (m + 1) * D * a, m);
    most = std::max(most, rho_[a]);
  }
  double longest = 0;
  for (std::size_t a = 0; a < count; ++a) {
    // a contact that moves nothing has no own scale
    rho_[a] = 1 / (rho_[a] > 0 ? rho_[a] : (most > 0 ? most : 1.0));
    double square = 0;
    for (std::size_t k = D * a; k < D * (a + 1); ++k) {
      z_[k] = r[k] - rho_[a] * u_[k];
      square += z_[k] * z_[k];
    }
    longest = std::max(longest, std::sqrt(square));
  }
  std::fill_n(A_.begin(), D * D * count, 0.0);
  std::fill_n(B_.begin(), D * D * count, 0.0);
  std::fill_n(by_mu_.begin(), m, 0.0);
  kept_.clear();
  for (std::size_t a = 0; a < count; ++a) {
    const std::size_t at = D * a;
    const Status status = status_of<D>(&z_[at], &u_[at], mu[a], longest);
    const double speed = status.speed;
    degenerate_[a] = status.degenerate;
    law_[a] = status.law;
    if (status.law == Law::open) continue;
    for (std::size_t k = at; k < at + D; ++k) kept_.push_back(k);
    double* const A = &A_[D * D * a];
    double* const B = &B_[D * D * a];
    if (status.law == Law::stick) {
      for (int k = 0; k < D; ++k) A[D * k + k] = rho_[a];
      continue;
    }
    // The law is dr_T + mu t dr_N + r_N t dmu + mu r_N / ||u_T|| P du_T = 0, P = I - t t^T, times
    // I - c P: no row grows without bound towards the border to stick. There rounding gives u a
    // direction, and z = r - rho u has that of both.
    double t[D - 1];
    for (int k = 0; k < D - 1; ++k) {
      const std::size_t place = at + 1 + static_cast<std::size_t>(k);
      t[k] = -z_[place] / (status.sliding != 0 ? status.sliding : 1.0);
    }
    const double bound = mu[a] * std::max(r[at], 0.0);
    const double c = bound > 0 ? bound / (bound + rho_[a] * speed) : 0.0;
    A[0] = rho_[a];
    for (int i = 1; i < D; ++i) {
      B[D * i] = mu[a] * t[i - 1];
      by_mu_[at + static_cast<std::size_t>(i)] = -r[at] * t[i - 1];
      for (int j = 1; j < D; ++j) {
        const double across = (i == j ? 1.0 : 0.0) - t[i - 1] * t[j - 1];
        A[D * i + j] = c * rho_[a] * across;
        B[D * i + j] = (i == j ? 1.0 : 0.0) - c * across;
      }
    }
  }

  // S = A W + B on the rows of contacts that are not open
  grow(whole_, m * m);
  for (std::size_t j = 0; j < m; ++j) columns_[j] = 0;
  for (std::size_t a = 0; a < count; ++a) {
    if (law_[a] == Law::open) {
      for (std::size_t k = D * a; k < D * (a + 1); ++k) columns_[k] += 1;
      continue;
    }
    for (std::size_t i = 0; i < D; ++i) {
      double* __restrict const to = &whole_[m * (D * a + i)];
      const double* const A = &A_[D * D * a + D * i];
      const double* __restrict const first = W + m * D * a;
      if constexpr (D == 2) {
        for (std::size_t j = 0; j < m; ++j) to[j] = A[0] * first[j] + A[1] * first[m + j];
      } else {
        for (std::size_t j = 0; j < m; ++j) {
          to[j] = A[0] * first[j] + A[1] * first[m + j] + A[2] * first[2 * m + j];
        }
      }
      for (std::size_t j = 0; j < D; ++j) to[D * a + j] += B_[D * D * a + D * i + j];
      for (std::size_t j = 0; j < m; ++j) columns_[j] += to[j] * to[j];
    }
  }
  for (std::size_t j = 0; j < m; ++j) columns_[j] = columns_[j] > 0 ? std::sqrt(columns_[j]) : 1.0;
  for (std::size_t j = 0; j < m; ++j) x_[j] = 1 / columns_[j];
  const std::size_t n = kept_.size();
  grow(system_, n * n);
  for (std::size_t i = 0; i < n; ++i) {
    const double* const from = &whole_[m * kept_[i]];
    double square = 0;
    for (std::size_t j = 0; j < m; ++j) {
      const double scaled = from[j] * x_[j];
      square += scaled * scaled;
    }
    rows_[i] = square > 0 ? std::sqrt(square) : 1.0;
    const double inverse = 1 / rows_[i];
    double* const to = &system_[n * i];
    for (std::size_t j = 0; j < n; ++j) to[j] = from[kept_[j]] * x_[kept_[j]] * inverse;
  }
  for (std::size_t j = 0; j < n; ++j) columns_[j] = columns_[kept_[j]];
  factors_.factorise(system_, n);
  return true;
}

template <int D>
void Point<D>::solve(bool transposed, double* x) {
  const std::size_t n = kept_.size();
  const auto& left = transposed ? columns_ : rows_;
  const auto& right = transposed ? rows_ : columns_;
  for (std::size_t i = 0; i < n; ++i) x[i] /= left[i];
  factors_.solve(transposed, x);
  for (std::size_t i = 0; i < n; ++i) x[i] /= right[i];
}

template <int D>
void Point<D>::adjoint(const double* by_r, const double* by_u, double* by_W, double* by_q,
                       double* by_mu) {
  const std::size_t n = kept_.size();
  for (std::size_t i = 0; i < n; ++i) x_[i] = by_r != nullptr ? by_r[kept_[i]] : 0.0;
  if (by_u != nullptr) {
    for (std::size_t row = 0; row < m_; ++row) {
      if (by_u[row] == 0) continue;
      for (std::size_t i = 0; i < n; ++i) x_[i] += W_[m_ * row + kept_[i]] * by_u[row];
    }
  }
  solve(true, x_.data());
  // the law's multipliers, contact by contact
  double* const change = by_q != nullptr ? by_q : y_.data();
  for (std::size_t k = 0; k < m_; ++k) change[k] = by_u != nullptr ? by_u[k] : 0.0;
  for (std::size_t i = 0; i < n; i += D) {
    const std::size_t a = kept_[i] / D;
    double part[D];
    by_velocity(a, true, &x_[i], part);
    for (std::size_t k = 0; k < D; ++k) change[D * a + k] -= part[k];
  }
  if (by_mu != nullptr) {
    std::fill_n(by_mu, nc_, 0.0);
    for (std::size_t i = 0; i < n; ++i) by_mu[kept_[i] / D] += by_mu_[kept_[i]] * x_[i];
  }
  if (by_W == nullptr) return;
  for (std::size_t row = 0; row < m_; ++row) {
    for (std::size_t col = 0; col < m_; ++col) by_W[m_ * row + col] = change[row] * r_[col];
  }
}

template <int D>
void Point<D>::forward(const double* dW, const double* dq, const double* dmu, double* dr,
                       double* du) {
  const std::size_t n = kept_.size();
  // the change of u at the same reactions
  for (std::size_t row = 0; row < m_; ++row) {
    double sum = dq != nullptr ? dq[row] : 0.0;
    if (dW != nullptr) {
      for (std::size_t col = 0; col < m_; ++col) sum += dW[m_ * row + col] * r_[col];
    }
    y_[row] = sum;
  }
  for (std::size_t i = 0; i < n; i += D) {
    const std::size_t a = kept_[i] / D;
    by_velocity(a, false, &y_[D * a], &x_[i]);
    for (std::size_t k = 0; k < D; ++k) {
      x_[i + k] = (dmu != nullptr ? by_mu_[D * a + k] * dmu[a] : 0.0) - x_[i + k];
    }
  }
  solve(false, x_.data());
  if (dr != nullptr) {
    std::fill_n(dr, m_, 0.0);
    for (std::size_t i = 0; i < n; ++i) dr[kept_[i]] = x_[i];
  }
  if (du == nullptr) return;
  for (std::size_t row = 0; row < m_; ++row) {
    double sum = y_[row];
    for (std::size_t i = 0; i < n; ++i) sum += W_[m_ * row + kept_[i]] * x_[i];
    du[row] = sum;
  }
}

template <int D>
void Point<D>::sensitivities(double* by_q, double* by_mu) {
  const std::size_t n = kept_.size();
  const auto nc = static_cast<std::size_t>(nc_);
  if (by_q != nullptr) std::fill_n(by_q, m_ * m_, 0.0);
  if (by_mu != nullptr) std::fill_n(by_mu, m_ * nc, 0.0);
  for (std::size_t first = 0; first < n; first += D) {
    const std::size_t a = kept_[first] / D;
    // a column for each component of q^a, and one for mu^a
    for (std::size_t k = 0; k <= D; ++k) {
      double* const to = k < D ? by_q : by_mu;
      if (to == nullptr) continue;
      std::fill_n(x_.begin(), n, 0.0);
      for (std::size_t i = 0; i < D; ++i) {
        x_[first + i] = k < D ? -A_[D * D * a + D * i + k] : by_mu_[D * a + i];
      }
      solve(false, x_.data());
      const std::size_t width = k < D ? m_ : nc;
      const std::size_t column = k < D ? D * a + k : a;
      for (std::size_t i = 0; i < n; ++i) to[width * kept_[i] + column] = x_[i];
    }
  }
}

bool all_zero(const double* x, std::int64_t size) {
  return x == nullptr || std::all_of(x, x + size, [](double one) { return one == 0; });
}
void fill(double* x, std::int64_t size, double value) {
  if (x != nullptr) std::fill_n(x, size, value);
}

/// Shares the problems among threads; `one(k, point, W, q, mu)` does one, with the places of its
/// arrays.
template <int D, class One>
void run(const SolvedBatch& batch, const DerivativeSettings& settings, const One& one) {
  struct Place {
    std::int64_t W = 0;
    std::int64_t q = 0;
    std::int64_t mu = 0;
  };
  const auto contacts = [&](std::int64_t k) -> std::int64_t {
    return batch.nc == nullptr ? batch.nc_each : batch.nc[k];
  };
  const auto advance = [](Place& place, std::int64_t nc) {
    place.W += D * nc * D * nc;
    place.q += D * nc;
    place.mu += nc;
  };
  const std::int64_t chunks = (batch.count + chunk - 1) / chunk;
  std::vector<Place> starts;
  if (batch.nc != nullptr) {
    Place place;
    for (std::int64_t k = 0; k < batch.count; ++k) {
      if (k % chunk == 0) starts.push_back(place);
      advance(place, contacts(k));
    }
  }
  std::atomic<std::int64_t> next = 0;
  std::atomic<bool> stopped = false;
  std::mutex mutex;
  std::exception_ptr failure;
  const auto work = [&](int worker) {
    thread_local Point<D> memory;
    Point<D>& point = memory;
    OneContact<D> single;
    double last_poll = worker == 0 && settings.poll ? now({}) : 0.0;
    try {
      for (;;) {
        const std::int64_t first = next.fetch_add(chunk, std::memory_order_relaxed);
        if (first >= batch.count) return;
        if (worker == 0 && settings.poll && now({}) - last_poll > poll_interval) {
          last_poll = now({});
          if (!settings.poll()) stopped = true;
        }
        Place place;
        if (batch.nc != nullptr) {
          place = starts[static_cast<std::size_t>(first / chunk)];
        } else {
          advance(place, batch.nc_each);
          for (std::int64_t* part : {&place.W, &place.q, &place.mu}) *part *= first;
        }
        for (std::int64_t k = first; k < std::min(first + chunk, batch.count); ++k) {
          const std::int64_t nc = contacts(k);
          const double* const W = batch.W + place.W;
          const double* const q = batch.q + place.q;
          const double* const mu = batch.mu + place.mu;
          const double* const r = batch.r + place.q;
          const auto found = [&](const auto* solved) {
            if (batch.unique != nullptr) {
              batch.unique[k] = solved != nullptr && solved->unique() ? 1 : 0;
            }
            for (std::int64_t a = 0; batch.degenerate != nullptr && a < nc; ++a) {
              batch.degenerate[place.mu + a] = solved != nullptr && solved->degenerate(a) ? 1 : 0;
            }
          };
          if (nc == 1 && !stopped && single.take(W, q, mu, r)) {
            found(&single);
            one(&single, nc, place.W, place.q, place.mu);
          } else {
            Point<D>* const solved = !stopped && point.take(nc, W, q, mu, r) ? &point : nullptr;
            found(solved);
            one(solved, nc, place.W, place.q, place.mu);
          }
          advance(place, nc);
        }
      }
    } catch (...) {
      const std::lock_guard lock(mutex);
      failure = std::current_exception();
    }
  };
  int threads = settings.threads;
  if (threads == 0) threads = static_cast<int>(std::thread::hardware_concurrency());
  threads =
      static_cast<int>(std::clamp<std::int64_t>(threads, 1, std::max<std::int64_t>(chunks, 1)));
  if (threads == 1) {
    work(0);
  } else {
    Workers workers(threads);
    workers.run(work);
  }
  if (failure) std::rethrow_exception(failure);
}

template <class One>
void run_in(const SolvedBatch& batch, std::int64_t sides, const DerivativeSettings& settings,
            const One& one) {
  const auto refuse = [](const char* where, const std::string& what) {
    throw Error(ErrorKind::problem, what, where);
  };
  if (batch.spacedim != 2 && batch.spacedim != 3) {
    refuse("spacedim", "is " + std::to_string(batch.spacedim) + ", expected 2 or 3");
  }
  if (batch.count < 0) refuse("count", "is negative");
  if (sides < 0) refuse("sides", "is negative");
  if (settings.threads < 0) throw Error(ErrorKind::option, "is negative", "threads");
  for (std::int64_t k = 0; k < (batch.nc == nullptr ? 1 : batch.count); ++k) {
    const std::int32_t nc = batch.nc == nullptr ? batch.nc_each : batch.nc[k];
    if (nc < 0) refuse("nc", "problem " + std::to_string(k) + " has " + std::to_string(nc));
  }
  if (batch.spacedim == 2) {
    run<2>(batch, settings, one);
  } else {
    run<3>(batch, settings, one);
  }
}

}  // namespace

void adjoint(const SolvedBatch& batch, const Adjoint& what, const DerivativeSettings& settings) {
  const auto one = [&](auto* point, std::int64_t nc, std::int64_t W, std::int64_t q,
                       std::int64_t mu) {
    const std::int64_t m = batch.spacedim * nc;
    const auto at = [](auto* array, std::int64_t by) {
      return array == nullptr ? nullptr : array + by;
    };
    for (std::int64_t side = 0; side < what.sides; ++side) {
      const double* const by_r = at(what.r, what.sides * q + side * m);
      const double* const by_u = at(what.u, what.sides * q + side * m);
      double* const by_W = at(what.W, what.sides * W + side * m * m);
      double* const by_q = at(what.q, what.sides * q + side * m);
      double* const by_mu = at(what.mu, what.sides * mu + side * nc);
      const bool zero = all_zero(by_r, m) && all_zero(by_u, m);
      if (point != nullptr && !zero) {
        point->adjoint(by_r, by_u, by_W, by_q, by_mu);
        continue;
      }
      const double value = zero ? 0.0 : nothing;
      fill(by_W, m * m, value);
      fill(by_q, m, value);
      fill(by_mu, nc, value);
    }
  };
  run_in(batch, what.sides, settings, one);
}

void forward(const SolvedBatch& batch, const Forward& what, const DerivativeSettings& settings) {
  const auto one = [&](auto* point, std::int64_t nc, std::int64_t W, std::int64_t q,
                       std::int64_t mu) {
    const std::int64_t m = batch.spacedim * nc;
    const auto at = [](auto* array, std::int64_t by) {
      return array == nullptr ? nullptr : array + by;
    };
    for (std::int64_t side = 0; side < what.sides; ++side) {
      const double* const dW = at(what.W, what.sides * W + side * m * m);
      const double* const dq = at(what.q, what.sides * q + side * m);
      const double* const dmu = at(what.mu, what.sides * mu + side * nc);
      double* const dr = at(what.r, what.sides * q + side * m);
      double* const du = at(what.u, what.sides * q + side * m);
      const bool zero = all_zero(dW, m * m) && all_zero(dq, m) && all_zero(dmu, nc);
      if (point != nullptr && !zero) {
        point->forward(dW, dq, dmu, dr, du);
        continue;
      }
      fill(dr, m, zero ? 0.0 : nothing);
      fill(du, m, zero ? 0.0 : nothing);
    }
  };
  run_in(batch, what.sides, settings, one);
}

void sensitivities(const SolvedBatch& batch, const Sensitivities& what,
                   const DerivativeSettings& settings) {
  const auto one = [&](auto* point, std::int64_t nc, std::int64_t W, std::int64_t,
                       std::int64_t mu) {
    const std::int64_t m = batch.spacedim * nc;
    double* const by_q = what.by_q == nullptr ? nullptr : what.by_q + W;
    double* const by_mu = what.by_mu == nullptr ? nullptr : what.by_mu + m * mu;
    if (point != nullptr) {
      point->sensitivities(by_q, by_mu);
      return;
    }
    fill(by_q, m * m, 0.0);
    fill(by_mu, m * nc, 0.0);
  };
  if (what.by_mu != nullptr && batch.nc != nullptr) {
    throw Error(ErrorKind::problem, "is for problems with the same number of contacts", "by_mu");
  }
  run_in(batch, 1, settings, one);
}

}  // namespace fclib
