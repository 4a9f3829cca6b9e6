# fdi_lio_add_gtest(NAME SOURCES a.cpp ... LIBS lib ...): one gtest executable, run by ctest under NAME.
function(fdi_lio_add_gtest name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LIBS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE fdi_lio_options ${ARG_LIBS} GTest::gtest_main GTest::gmock)
  add_test(NAME ${name} COMMAND ${name})
endfunction()
