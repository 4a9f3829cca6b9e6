# Warnings are errors in our own code; headers of ROS and other libraries are system headers.
add_library(fdi_lio_options INTERFACE)
target_compile_options(fdi_lio_options INTERFACE -Wall -Wextra -Werror)
target_include_directories(fdi_lio_options INTERFACE ${PROJECT_SOURCE_DIR}/include)
target_compile_definitions(fdi_lio_options INTERFACE FDI_LIO_VERSION="${PROJECT_VERSION}")
# Eigen's static vectorisation and FMA contraction must not differ between builds that are compared.
target_compile_options(fdi_lio_options INTERFACE -ffp-contract=off)
# Nobody here reads errno or floating-point traps, and they keep loops from being vectorised. No result changes.
target_compile_options(fdi_lio_options INTERFACE -fno-math-errno -fno-trapping-math)

# An installed program finds our libraries without an environment.
set(CMAKE_INSTALL_RPATH "$ORIGIN;$ORIGIN/..")

set(sanitizers_address address,undefined)
set(sanitizers_undefined undefined)
set(sanitizers_thread thread)
if(FDI_LIO_SANITIZER)
  if(NOT DEFINED sanitizers_${FDI_LIO_SANITIZER})
    message(FATAL_ERROR
      "FDI_LIO_SANITIZER is '${FDI_LIO_SANITIZER}': use address, undefined, thread, or leave it empty")
  endif()
  set(sanitizer_flags -fsanitize=${sanitizers_${FDI_LIO_SANITIZER}} -fno-sanitize-recover=all)
  target_compile_options(fdi_lio_options INTERFACE ${sanitizer_flags} -fno-omit-frame-pointer -g)
  target_link_options(fdi_lio_options INTERFACE ${sanitizer_flags})
endif()
