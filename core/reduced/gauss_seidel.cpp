#include "reduced/gauss_seidel.hpp"

namespace fclib {

template <class Cone>
GaussSeidel<Cone>::GaussSeidel(const ReducedProblem& problem, double omega) : problem_(problem) {
  contacts_.reserve(static_cast<std::size_t>(problem.nc()));
  for (Index a = 0; a < problem.nc(); ++a) {
    contacts_.emplace_back(problem.W.template diagonal_block<D>(a) / omega,
                           Cone(problem.friction, a));
  }
}

template <class Cone>
auto GaussSeidel<Cone>::update(Index a, Vector& r, Vector& u, const LocalStep<Cone>& step) -> Vec {
  Contact& contact = contacts_[static_cast<std::size_t>(a)];
  const Vec old = r.segment<D>(D * a);
  const Vec b = u.segment<D>(D * a) - contact.projected.block() * old;
  Vec next = old;
  step(contact, b, next);
  const Vec delta = next - old;
  if ((delta.array() == 0).all()) return delta;
  r.segment<D>(D * a) = next;
  problem_.W.template add_column<D>(a, delta.data(), u.data());
  return delta;
}

template <class Cone>
void GaussSeidel<Cone>::sweep(Vector& r, Vector& u) {
  const LocalStep<Cone> step;
  for (Index a = 0; a < problem_.nc(); ++a) update(a, r, u, step);
}

#define FCLIB_INSTANTIATE(Cone) template class GaussSeidel<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
