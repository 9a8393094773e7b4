#include "contact/rolling.hpp"

namespace fclib {

template class Rolling<3>;
template class Rolling<5>;

}  // namespace fclib
