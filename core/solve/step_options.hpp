// The options that the self-adaptive projection methods share.
#pragma once

#include "kernels/self_adaptive_step.hpp"
#include "kernels/variational_inequality.hpp"
#include "solve/options.hpp"

namespace fclib {

struct StepOptions {
  Metric metric = Metric::contact;
  double rho = 1.0;
  double tau = 2.0 / 3.0;
  double ratio_high = 0.9;
  double ratio_low = 0.3;

  [[nodiscard]] StepRule rule() const { return {rho, tau, ratio_high, ratio_low}; }

  static constexpr auto fields() {
    using O = StepOptions;
    return std::tuple{
        OptionField<O, Metric>{
            .name = "metric", .member = &O::metric, .doc = metric_doc, .choices = metrics},
        OptionField<O, double>{.name = "rho",
                               .member = &O::rho,
                               .unit = "1/W_aa",
                               .doc = "first step",
                               .lowest = 1e-12,
                               .highest = 1e12},
        OptionField<O, double>{.name = "tau",
                               .member = &O::tau,
                               .unit = "1",
                               .doc = "factor by which the step shrinks, or by whose inverse it "
                                      "grows",
                               .lowest = 0.01,
                               .highest = 0.99},
        OptionField<O, double>{.name = "ratio_high",
                               .member = &O::ratio_high,
                               .unit = "1",
                               .doc = "L: the step shrinks while its ratio is above this",
                               .lowest = 1e-3,
                               .highest = 1},
        OptionField<O, double>{.name = "ratio_low",
                               .member = &O::ratio_low,
                               .unit = "1",
                               .doc = "L_min: the step grows where its ratio is under this",
                               .lowest = 0,
                               .highest = 1},
    };
  }
};

}  // namespace fclib
