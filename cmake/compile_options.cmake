# Warnings are errors in our own code; headers of ROS and other libraries are system headers.
add_library(fdi_lio_options INTERFACE)
target_compile_options(fdi_lio_options INTERFACE -Wall -Wextra -Werror)
target_include_directories(fdi_lio_options INTERFACE ${PROJECT_SOURCE_DIR}/include)
target_compile_definitions(fdi_lio_options INTERFACE FDI_LIO_VERSION="${PROJECT_VERSION}")
# Eigen's static vectorisation and FMA contraction must not differ between builds that are compared.
target_compile_options(fdi_lio_options INTERFACE -ffp-contract=off)

if(FDI_LIO_SANITIZER STREQUAL "address")
  target_compile_options(fdi_lio_options INTERFACE -fsanitize=address,undefined -fno-omit-frame-pointer -g)
  target_link_options(fdi_lio_options INTERFACE -fsanitize=address,undefined)
elseif(FDI_LIO_SANITIZER STREQUAL "thread")
  target_compile_options(fdi_lio_options INTERFACE -fsanitize=thread -fno-omit-frame-pointer -g)
  target_link_options(fdi_lio_options INTERFACE -fsanitize=thread)
elseif(NOT FDI_LIO_SANITIZER STREQUAL "")
  message(FATAL_ERROR "FDI_LIO_SANITIZER is '${FDI_LIO_SANITIZER}': use address, thread, or leave it empty")
endif()
