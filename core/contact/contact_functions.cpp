#include "contact/contact_functions.hpp"

#include "error.hpp"

namespace fclib {

namespace {

template <class Function, class Cone>
ContactFunction<Cone> entry() {
  return {.value = &Function::value, .jacobian = &Function::jacobian, .split = Function::split};
}

}  // namespace

template <class Cone>
ContactFunction<Cone> contact_function(ContactFunctionKind kind) {
  switch (kind) {
    case ContactFunctionKind::alart_curnier:
      return entry<AlartCurnier<Cone>, Cone>();
    case ContactFunctionKind::jean_moreau:
      return entry<JeanMoreau<Cone>, Cone>();
    case ContactFunctionKind::natural_map:
      return entry<NaturalMap<Cone>, Cone>();
    case ContactFunctionKind::fischer_burmeister:
      if constexpr (Cone::groups == 1) return entry<FischerBurmeister<Cone>, Cone>();
  }
  throw Error(ErrorKind::unsuitable, "is not known for contacts with rolling or spin friction",
              "the function of Fischer & Burmeister");
}

#define FCLIB_INSTANTIATE(Cone) \
  template ContactFunction<Cone> contact_function<Cone>(ContactFunctionKind);
FCLIB_FOR_EACH_CONE(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
