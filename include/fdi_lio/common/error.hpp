#pragma once

#include <stdexcept>
#include <string>

namespace fdi_lio {

/// An error that the user can mend: the text says what is wrong, where, and what to do.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace fdi_lio
