#include "embed/body_form.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "embed/contact_judge.hpp"
#include "embed/memory.hpp"

namespace fclib {

template <int D>
const char* BodyForm<D>::take(const Given& given) {
  given_ = given;
  const auto n = static_cast<std::size_t>(given.n);
  const std::size_t m = D * static_cast<std::size_t>(given.nc);
  const auto finite = [](const double* x, std::size_t size) {
    double sum = 0;  // zero, or NaN: without a branch
    for (std::size_t k = 0; k < size; ++k) sum += x[k] * 0.0;
    return sum == 0;
  };
  if (!finite(given.M, n * n)) return "M: has an entry that is not finite";
  if (!finite(given.H, n * m)) return "H: has an entry that is not finite";
  if (!finite(given.f, n)) return "f: has an entry that is not finite";
  if (given.w != nullptr && !finite(given.w, m)) return "w: has an entry that is not finite";
  if (const char* wrong = factorise()) return wrong;

  for (auto* vector : {&y_, &column_, &v_}) grow(*vector, n);
  for (auto* vector : {&free_, &u_}) grow(*vector, m);
  grow(q_, m);
  for (std::size_t k = 0; k < n; ++k) y_[k] = given.f[k];
  forward(y_.data(), 0);

  // columns of H, and of L^-1 H: contact by contact the rows that are not zero
  entries_.clear();
  rows_.clear();
  half_.clear();
  grow(at_, m + 1);
  grow(rows_at_, static_cast<std::size_t>(given.nc) + 1);
  if (touch_.size() < n) touch_.resize(n);
  for (std::size_t k = 0; k < n; ++k) touch_[k].clear();
  grow(contact_, n * D);
  for (std::size_t a = 0; a < static_cast<std::size_t>(given.nc); ++a) {
    rows_at_[a] = rows_.size();
    std::size_t least = n;
    for (std::size_t k = 0; k < D; ++k) {
      const double* from = given.H + (D * a + k) * n;
      at_[D * a + k] = entries_.size();
      for (std::size_t row = 0; row < n; ++row) {
        column_[row] = from[row];
        if (from[row] != 0) entries_.push_back({static_cast<Index>(row), from[row]});
      }
      const bool any = entries_.size() > at_[D * a + k];
      const Index first = any ? entries_[at_[D * a + k]].row : given.n;
      forward(column_.data(), first);
      Real sum = given.w != nullptr ? Real(given.w[D * a + k]) : Real(0);
      for (auto row = static_cast<std::size_t>(first); row < n; ++row)
        sum += column_[row] * y_[row];
      free_[D * a + k] = sum;
      q_[D * a + k] = static_cast<double>(sum);
      for (std::size_t row = 0; row < n; ++row) {
        contact_[D * row + k] = static_cast<double>(column_[row]);
      }
      least = std::min(least, static_cast<std::size_t>(first));
    }
    for (std::size_t row = least; row < n; ++row) {
      const double* numbers = &contact_[D * row];
      if (std::all_of(numbers, numbers + D, [](double x) { return x == 0; })) continue;
      touch_[row].emplace_back(static_cast<Index>(a), half_.size());
      rows_.push_back(static_cast<Index>(row));
      half_.insert(half_.end(), numbers, numbers + D);
    }
  }
  at_[m] = entries_.size();
  rows_at_[static_cast<std::size_t>(given.nc)] = rows_.size();

  // W, row of blocks by row of blocks
  const auto nc = static_cast<std::size_t>(given.nc);
  grow(starts_, nc + 1);
  grow(block_of_, nc);
  std::fill(block_of_.begin(), block_of_.end(), -1);
  columns_.clear();
  values_.clear();
  for (std::size_t a = 0; a < nc; ++a) {
    const auto first = static_cast<std::ptrdiff_t>(columns_.size());
    starts_[a] = static_cast<std::int32_t>(first);
    for (std::size_t k = rows_at_[a]; k < rows_at_[a + 1]; ++k) {
      const double* own = &half_[D * k];
      for (const auto& [b, at] : touch_[static_cast<std::size_t>(rows_[k])]) {
        std::ptrdiff_t& place = block_of_[static_cast<std::size_t>(b)];
        if (place < first) {
          place = static_cast<std::ptrdiff_t>(columns_.size());
          columns_.push_back(b);
          values_.resize(values_.size() + D * D, 0.0);
        }
        double* block = &values_[static_cast<std::size_t>(place) * D * D];
        for (int i = 0; i < D; ++i) {
          for (int j = 0; j < D; ++j) {
            block[D * i + j] += own[i] * half_[at + static_cast<std::size_t>(j)];
          }
        }
      }
    }
  }
  starts_[nc] = static_cast<std::int32_t>(columns_.size());
  return nullptr;
}

/// M = L L^T inside the envelope of M.
template <int D>
const char* BodyForm<D>::factorise() {
  using std::sqrt;  // or that of Real
  const auto n = static_cast<std::size_t>(given_.n);
  grow(begin_, n);
  grow(L_, n * n);
  for (std::size_t i = 0; i < n; ++i) {
    const double* row = given_.M + n * i;
    std::size_t first = 0;
    while (first < i && row[first] == 0) ++first;
    begin_[i] = static_cast<Index>(first);
    Real* to = &L_[n * i];
    for (std::size_t j = first; j <= i; ++j) {
      Real sum = row[j];
      const Real* other = &L_[n * j];
      for (auto k = std::max(first, static_cast<std::size_t>(begin_[j])); k < j; ++k) {
        sum -= to[k] * other[k];
      }
      if (j < i) {
        to[j] = sum / other[j];
      } else {
        // less than the rounding of the entry: M is singular
        if (!(sum > Real(std::numeric_limits<double>::epsilon()) * row[i])) {
          return "M: is not positive definite";
        }
        to[i] = sqrt(sum);
      }
    }
  }
  return nullptr;
}

/// x = L^-1 x; x is zero before `first`.
template <int D>
void BodyForm<D>::forward(Real* x, Index first) const {
  const auto n = static_cast<std::size_t>(given_.n);
  auto last = static_cast<std::ptrdiff_t>(first) - 1;  // the last row that is not zero
  for (auto i = static_cast<std::size_t>(first); i < n; ++i) {
    const auto begin =
        std::max(static_cast<std::size_t>(begin_[i]), static_cast<std::size_t>(first));
    if (x[i] == 0 && static_cast<std::ptrdiff_t>(begin) > last) continue;
    const Real* row = &L_[n * i];
    Real sum = x[i];
    for (std::size_t k = begin; k < i; ++k) sum -= row[k] * x[k];
    x[i] = sum / row[i];
    if (x[i] != 0) last = static_cast<std::ptrdiff_t>(i);
  }
}

/// x = L^-T x
template <int D>
void BodyForm<D>::backward(Real* x) const {
  const auto n = static_cast<std::size_t>(given_.n);
  for (std::size_t i = n; i-- > 0;) {
    const Real* row = &L_[n * i];
    x[i] = x[i] / row[i];
    for (auto k = static_cast<std::size_t>(begin_[i]); k < i; ++k) x[k] -= row[k] * x[i];
  }
}

template <int D>
double BodyForm<D>::judge(const double* mu, const double* r, double* u, double* v) {
  using std::abs;  // or that of Real
  const auto n = static_cast<std::size_t>(given_.n);
  const std::size_t m = D * static_cast<std::size_t>(given_.nc);
  for (std::size_t k = 0; k < n; ++k) v_[k] = given_.f[k];
  for (std::size_t col = 0; col < m; ++col) {
    if (r[col] == 0) continue;
    for (std::size_t k = at_[col]; k < at_[col + 1]; ++k) {
      v_[static_cast<std::size_t>(entries_[k].row)] += full_product(entries_[k].value, r[col]);
    }
  }
  forward(v_.data(), 0);
  backward(v_.data());
  if (v != nullptr) {
    for (std::size_t k = 0; k < n; ++k) v[k] = static_cast<double>(v_[k]);
  }
  for (std::size_t col = 0; col < m; ++col) {
    Real sum = given_.w != nullptr ? Real(given_.w[col]) : Real(0);
    for (std::size_t k = at_[col]; k < at_[col + 1]; ++k) {
      sum += full_product(entries_[k].value, v_[static_cast<std::size_t>(entries_[k].row)]);
    }
    u_[col] = sum;
    if (u != nullptr) u[col] = static_cast<double>(sum);
  }
  using Vec = ContactVector<D, Real>;
  const auto size = [&](std::int64_t a) {
    Real sum = 0;
    for (std::size_t k = D * rows_at_[static_cast<std::size_t>(a)];
         k < D * rows_at_[static_cast<std::size_t>(a) + 1]; ++k) {
      sum += full_product(half_[k], half_[k]);
    }
    return Real(sum / static_cast<double>(D));
  };
  const auto of = [](const std::vector<Real>& x) {
    return [&x](std::int64_t a) {
      Vec part;
      for (int k = 0; k < D; ++k) part[k] = x[static_cast<std::size_t>(D * a + k)];
      return part;
    };
  };
  return contact_error<D>(given_.nc, mu, r, size, of(u_), of(free_));
}

template class BodyForm<2>;
template class BodyForm<3>;

}  // namespace fclib
