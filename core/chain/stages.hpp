// The methods of a chain's table at work: on the whole problem, or on one island of contacts.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>

#include "chain/table.hpp"
#include "chain/tracker.hpp"
#include "contact/cones.hpp"
#include "reduced/gauss_seidel.hpp"
#include "systems/coupled_system.hpp"

namespace fclib::chain {

/// What a chain may use of the machine.
struct Resources {
  int threads = 1;
  double memory = 0;  ///< [bytes] memory for factors; 0: what is available
};

template <class Cone>
class Island {
 public:
  static constexpr int D = Cone::dim;

  /// `proves` tells whether y (nc of the island) proves that there is no solution.
  Island(const ReducedProblem& problem, const Table& table, const Resources& resources,
         Tracker& tracker, double tolerance, bool guessed,
         std::function<bool(const Vector&)> proves);

  /// Starts from r and runs the stages for the whole or for islands. The best iterate ends in r.
  /// Returns its error relative to the problem's scale.
  double solve(Vector& r, On on);

 private:
  [[nodiscard]] bool done() const { return error_ <= tolerance_ || tracker_.stopped(); }

  // ---- the checkpoints between stages

  /// Sets what later stages start from. It is called before the first stage that needs it.
  void remember(const StageRule& rule);
  [[nodiscard]] bool applies(const StageRule& rule) const;
  /// Whether there is enough memory for what the method factorises.
  [[nodiscard]] bool affordable(const StageRule& rule);
  bool fits(double bytes);
  /// The largest share of a contact's mobility that bilateral constraints take away. rho still
  /// holds the mobility without them.
  [[nodiscard]] double jointed() const;
  void enter(const StageRule& rule);
  [[nodiscard]] Vector start_of(Start from) const;
  /// Keeps r if it is the best so far. Returns whether the stage should end.
  bool take(std::int64_t iterations, double error, const Vector& r);
  /// Goes back to the best iterate. What the sweeps keep of each contact may have overflown, so it
  /// is made anew.
  void return_to_best();
  CoupledSystem& system();

  // ---- the methods

  void run(const GaussSeidelStage& rules);
  /// Whether so many operations of sweeps take at most the time of so many factorisations. The
  /// system is analysed only if that decides.
  bool pays(double operations, double factorisations);
  /// The number of steps that a stage may make, from what one step costs [operations].
  double paid_for(const Patience& rules, double cost);
  void run(const SweepOnStage& rules);
  void run(const SpectralGradientStage& rules);
  void run(const ConjugateGradientsStage& rules);
  void run(const AlternatingDirectionsStage& rules);
  void project(Vector& r) const;
  [[nodiscard]] double violation(const Vector& r) const;
  void proximal(ProximalRules rules, Vector r);
  void run(const PolishStage& rules) { proximal(rules, start_of(rules.from)); }
  void run(const ProximalStage& rules);
  class ProximalPolish;
  void run(const InteriorPointStage& stage);
  void run(const HeldBodiesStage& rules);
  /// Follows the path around its folds.
  void run(const HomotopyStage& rules);
  void run(const NewtonStage& rules);
  void descend(SemismoothNewton<Cone>& newton, const NewtonRules& rules, std::int64_t left,
               Vector r);
  void run(const PivotingStage& rules);
  /// About the size of the rounding of u for these reactions, relative to the scale.
  [[nodiscard]] double rounding_of_velocity(const Vector& r) const;
  void run(const RandomStartsStage& rules);
  void run(const NoSolutionStage& rules);
  void run(const AssociatedStage& rules);
  void run(const OwnUnitsStage& rules);

  const ReducedProblem& problem_;
  const Table& table_;
  const Resources& resources_;
  Tracker& tracker_;
  double tolerance_;
  bool guessed_;
  std::function<bool(const Vector&)> proves_;
  std::optional<GaussSeidel<Cone>> gauss_seidel_;
  std::optional<CoupledSystem> system_;
  Vector r_, u_, best_;
  Vector swept_, associated_;            // what stages start from
  std::int64_t own_factorisations_ = 0;  // factorisations of a stage with a system of its own
  double error_ = 0;
};

#define FCLIB_DECLARE(Cone) extern template class Island<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_DECLARE)
#undef FCLIB_DECLARE

}  // namespace fclib::chain
