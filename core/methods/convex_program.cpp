#include "methods/convex_program.hpp"

#include "reduced/convex_residual.hpp"

namespace fclib {

template <class Set>
ConvexProgram<Set>::ConvexProgram(const ReducedProblem& problem)
    : problem_(problem), shift_(Vector::Zero(problem.nc())) {
  contacts_.reserve(static_cast<std::size_t>(problem.nc()));
  for (Index a = 0; a < problem.nc(); ++a)
    contacts_.emplace_back(problem.W.template diagonal_block<D>(a));
}

template <class Set>
double ConvexProgram<Set>::residual(const Set& set, const Vector& r, const Vector& u) const {
  return convex_residual(problem_, set, shift_, r, u);
}

template <class Set>
void ConvexProgram<Set>::solve(ConvexMethod method, const Set& set, int steps, double accuracy,
                               std::int64_t limit, Vector& r, Vector& u, Due due, Follow follow) {
  switch (method) {
    case ConvexMethod::gauss_seidel:
      return gauss_seidel(set, steps, accuracy, limit, r, u, due, follow);
    case ConvexMethod::projected_gradient:
      return projected_gradient(set, accuracy, limit, r, u, due, follow);
    case ConvexMethod::admm:
      return admm(set, {}, accuracy, limit, r, u, due, follow);
  }
}

template <class Set>
void ConvexProgram<Set>::gauss_seidel(const Set& set, int steps, double accuracy,
                                      std::int64_t limit, Vector& r, Vector& u, Due due,
                                      Follow follow) {
  std::int64_t told = 0;
  for (std::int64_t k = 1; k <= limit; ++k) {
    for (Index a = 0; a < problem_.nc(); ++a) sweep_contact(set, a, steps, r, u);
    if (k % 4 != 1 && k != limit && !due(k - told)) continue;
    if (follow(k - told, r, u) || residual(set, r, u) <= accuracy) return;
    told = k;
  }
}

template <class Set>
void ConvexProgram<Set>::projected_gradient(const Set& set, double accuracy, std::int64_t limit,
                                            Vector& r, Vector& u, Due due, Follow follow) {
  if (!gradient_) gradient_.emplace(problem_, AcceleratedGradientRules{});
  gradient_->start(r, u);
  std::int64_t told = 0;
  for (std::int64_t k = 1; k <= limit; ++k) {
    gradient_->step(set, shift_);
    if (k > 4 && k % 4 != 0 && k != limit && !due(k - told)) continue;
    r = gradient_->x();
    u = gradient_->u();
    if (follow(k - told, r, u) || residual(set, r, u) <= accuracy) return;
    told = k;
  }
}

template <class Set>
void ConvexProgram<Set>::admm(const Set& set, const AlternatingDirectionsRules& rules,
                              double accuracy, std::int64_t limit, Vector& r, Vector& u, Due due,
                              Follow follow) {
  if (!admm_) admm_.emplace(problem_, system_.emplace(problem_), rules);
  if (!admm_->start(r, u, shift_)) return;
  std::int64_t told = 0;
  for (std::int64_t k = 1; k <= limit; ++k) {
    admm_->x_update(shift_);
    admm_->z_update(set);
    admm_->w_update();
    if (!admm_->adapt()) return;
    if (k > 4 && k % 4 != 0 && k != limit && !due(k - told)) continue;
    r = admm_->z();
    problem_.velocity(r, u);
    if (follow(k - told, r, u) || residual(set, r, u) <= accuracy) return;
    told = k;
  }
}

template <class Set>
void ConvexProgram<Set>::sweep_contact(const Set& set, Index a, int steps, Vector& r, Vector& u) {
  const auto& contact = contacts_[static_cast<std::size_t>(a)];
  const Vec old = r.template segment<D>(D * a);
  Vec b = u.template segment<D>(D * a) - contact.block * old;
  b[0] += shift_[a];
  Vec next = old;
  set.minimise(a, contact, b, steps, next);
  const Vec delta = next - old;
  if ((delta.array() == 0).all()) return;
  r.template segment<D>(D * a) = next;
  problem_.W.template add_column<D>(a, delta.data(), u.data());
}

#define FCLIB_INSTANTIATE(Cone)              \
  template class ConvexProgram<Cones<Cone>>; \
  template class ConvexProgram<Cylinders<Cone>>;
FCLIB_FOR_EACH_CONE(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
