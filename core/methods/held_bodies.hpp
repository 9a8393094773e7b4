// Coulomb's law for problems in which few bodies move and all others rest, held by reactions that
// are far from unique. A convex problem on the whole and Newton's method on the bodies that move
// take turns.
//
// If s = mu ||u_T|| is given, the law u + (s, 0, 0) in K*, r in K, both orthogonal, is convex
// (methods/relaxation.hpp). Its velocity is unique and depends continuously on s. Coulomb's law is
// s = mu ||u_T(s)|| (Acary, Cadoux, Lemarechal & Malick 2011). That fixed point is sought on few
// bodies only:
//
//   1. the convex problem, by the interior point: what rests there rests to many digits, and its
//      reactions are at the centre of those that there are;
//   2. bodies that hardly move are held at rest. Coulomb's law for the others, from the reactions
//      of 1, gives s; s = 0 at contacts that hardly slide, and at those of held bodies alone.
//
// If 2 is solved and 1 then moves no other body, 1 has the velocity of 2 again, and is a solution.
// What counts as "hardly" goes to zero with the errors: bodies that creep while the others are not
// yet right may rest in the end, and 2 is far harder with them than without.
//
// Let W = H^T M^-1 H, and let B be the coordinates that are not held. The problem of 2 is u = W_B r
// + q_B on the contacts of B, with W_B = H_B^T M_BB^-1 H_B. q_B is such that the reactions of 1
// give the velocity of 1, except for what the held bodies add to it. A body is a set of coordinates
// that M links. How fast it is follows from u alone: v is the least-squares solution of H^T v = u,
// by one factorisation of H H^T + eps M.
#pragma once

#include <optional>
#include <tuple>
#include <vector>

#include "contact/coulomb.hpp"
#include "function_ref.hpp"
#include "linalg/factorization.hpp"
#include "solve/options.hpp"
#include "systems/coupled_system.hpp"

namespace fclib {

struct HeldBodiesRules {
  int rounds = 40;
  double creep = 0.1;

  static constexpr auto fields() {
    using O = HeldBodiesRules;
    return std::tuple{
        option("limit", &O::rounds, "rounds", {1, 1e9}, "The largest number of rounds of both."),
        option("creep", &O::creep, "error ||q||", {0},
               "The speed of a body, at one of its contacts, up to which it is held: a share of "
               "the error of the convex problem's solution.")};
  }
};

/// For problems that are known by their bodies, without bilateral constraints.
template <int D>
class HeldBodies {
 public:
  using Cone = Coulomb<D>;
  using Report = FunctionRef<bool(double error, const Vector& r)>;

  /// Keeps references. W is H^T M^-1 H of `primal`.
  HeldBodies(const ReducedProblem& problem, const Primal& primal, CoupledSystem& system);

  /// `report(error, r)` gets each solution of 1, `count()` is called at each iteration. If one of
  /// them returns true, the solve ends.
  void solve(const HeldBodiesRules& rules, double tolerance, Report report,
             FunctionRef<bool()> count);

  /// Factorisations on the bodies that move.
  [[nodiscard]] std::int64_t factorisations() const { return factorisations_; }

 private:
  /// The bodies that are not held, with their contacts.
  struct Part {
    std::vector<Index> contacts;
    Primal primal;
    ReducedProblem problem;
  };

  /// r_ and u_ of the convex problem with s = shift_. Returns false if it was ended.
  bool convex(FunctionRef<bool()> count);

  /// The bodies that are faster than `slow` at one of their contacts. Returns false if there is
  /// none.
  bool release(double slow, Part& part);

  /// Improves r of the part and sets its error. Returns false if it was ended.
  bool solve_part(const Part& part, bool far, double tolerance, Vector& r, double& error,
                  FunctionRef<bool()> count);

  const ReducedProblem& problem_;
  const Primal& primal_;
  CoupledSystem& system_;
  std::optional<Factorization> squares_;  // of H H^T + eps M
  std::vector<Index> body_;               // of each coordinate
  std::int64_t factorisations_ = 0;
  Vector shift_, r_, u_;
};

extern template class HeldBodies<2>;
extern template class HeldBodies<3>;

}  // namespace fclib
