#include "solve/best_iterate.hpp"

#include "error_size.hpp"
#include "reduced/relative_error.hpp"

namespace fclib {

template <class Cone>
BestIterate<Cone>::BestIterate(const ReducedProblem& problem, const Settings& settings,
                               const Vector& r)
    : problem_(problem),
      monitor_(settings),
      time_limit_(settings.time_limit),
      best_(r),
      fresh_(r.size()) {}

template <class Cone>
bool BestIterate<Cone>::report(std::int64_t count, const Vector& r, const Vector& u) {
  last_ = relative_error<Cone>(problem_, u, r);
  if (last_ <= monitor_.tolerance()) {
    problem_.velocity(r, fresh_);
    last_ = relative_error<Cone>(problem_, fresh_, r);
  }
  return report(count, r, last_);
}

template <class Cone>
bool BestIterate<Cone>::report(std::int64_t count, const Vector& r, double error) {
  last_ = error;
  keep(count, r, error);
  if (first_ || count > 0) stopped_ = monitor_.report(iterations_, error, &r);
  first_ = false;
  return stopped_.has_value();
}

template <class Cone>
bool BestIterate<Cone>::glance(std::int64_t count, const Vector& r) {
  problem_.velocity(r, fresh_);
  const double error = relative_error<Cone>(problem_, fresh_, r);
  const std::int64_t now = iterations_ + count;
  const auto status = monitor_.report(now, error, &r);
  const bool last = now >= monitor_.max_iterations() || monitor_.elapsed() > time_limit_;
  if (!status || (*status == Status::converged && !last)) return false;
  keep(count, r, error);
  stopped_ = status;
  return true;
}

template <class Cone>
bool BestIterate<Cone>::due(std::int64_t count) const {
  return iterations_ + count >= monitor_.max_iterations() || (count % 8 == 0 && monitor_.due());
}

template <class Cone>
Outcome BestIterate<Cone>::outcome(Vector& r, std::optional<double> cpu_s) const {
  r = best_;
  return {.status = stopped_.value_or(Status::stalled), .iterations = iterations_, .cpu_s = cpu_s};
}

template <class Cone>
void BestIterate<Cone>::keep(std::int64_t count, const Vector& r, double error) {
  if (first_ || error_size(error) < error_) {
    error_ = error_size(error);
    best_ = r;
  }
  iterations_ += count;
}

#define FCLIB_INSTANTIATE(Cone) template class BestIterate<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
