#include "io/siconos/layout.hpp"

#include <algorithm>
#include <string>

namespace fclib::siconos {

std::vector<Layout> layouts() {
  std::vector<Layout> result;
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    if (P::spin) return;  // Siconos has no such law
    Layout layout{.kind = P::kind, .rolling = P::rolling, .dimensions = P::dimensions};
    for_each_stored<P, Matrix>([&](const auto&) { ++layout.matrices; });
    result.push_back(layout);
  });
  return result;
}

bool has_dimension(const Layout& layout, Index d) {
  return std::find(layout.dimensions.begin(), layout.dimensions.end(), d) !=
         layout.dimensions.end();
}

std::optional<Layout> layout_of(std::string_view kind) {
  if (kind.empty()) return std::nullopt;
  std::string known;
  for (const Layout& layout : layouts()) {
    if (layout.kind == kind) return layout;
    known += (known.empty() ? "" : ", ") + std::string(layout.kind);
  }
  throw Error(ErrorKind::option,
              "there is no kind '" + std::string(kind) + "'; there are: " + known, "kind");
}

}  // namespace fclib::siconos
