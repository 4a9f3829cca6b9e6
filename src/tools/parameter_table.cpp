#include <iostream>

#include "fdi_lio/common/config_io.hpp"

/// Prints the table of docs/parameters.md from the declaration.
int main() { fdi_lio::write_parameter_table(std::cout); }
