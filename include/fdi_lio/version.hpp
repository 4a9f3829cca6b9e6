#pragma once

namespace fdi_lio {

/// The version of package.xml.
constexpr const char* kVersion = FDI_LIO_VERSION;

}  // namespace fdi_lio
