// A sweep of nonsmooth Gauss-Seidel over the contacts. The velocities are kept up to date by
// columns of W, so that a contact whose reaction does not change costs nothing.
#pragma once

#include <vector>

#include "kernels/contact_problem.hpp"
#include "kernels/delassus.hpp"

namespace fclib {

template <class Cone>
class GaussSeidel {
 public:
  static constexpr int D = Cone::dim;
  using Vec = typename Cone::Vec;
  using Contact = ContactProblem<Cone>;

  /// With omega, the contacts' problems are those of W_aa / omega: projected over-relaxation.
  explicit GaussSeidel(const Delassus& problem, double omega = 1) : problem_(problem) {
    contacts_.reserve(static_cast<std::size_t>(problem.nc()));
    for (Index a = 0; a < problem.nc(); ++a) {
      contacts_.emplace_back(problem.W.template diagonal_block<D>(a) / omega,
                             Cone(problem.friction, a));
    }
  }

  /// Solves the problem of contact a; `step(contact, b, next)` replaces next, r^a on entry. The
  /// change of r^a.
  template <class Step>
  Vec update(Index a, Vector& r, Vector& u, const Step& step) {
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

  /// One sweep in the order of the contacts, each solved exactly or by 10 projections at most.
  void sweep(Vector& r, Vector& u) {
    for (Index a = 0; a < problem_.nc(); ++a) {
      update(a, r, u, [](Contact& contact, const Vec& b, Vec& next) {
        if (!contact.solve_exact(b, next)) contact.projected.solve(b, 1e-14, 10, next);
      });
    }
  }

 private:
  const Delassus& problem_;
  std::vector<Contact> contacts_;
};

}  // namespace fclib
