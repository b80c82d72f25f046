# Settings every target of ours shares. Warnings are private: a consumer does not inherit them.
function(genu_configure_target target)
  target_compile_features(${target} PUBLIC cxx_std_17)
  target_compile_options(${target} PRIVATE
    $<$<COMPILE_LANGUAGE:CXX>:-Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Wold-style-cast -Wcast-qual>
    # Results must not depend on the compiler's taste for fused multiply-add.
    $<$<COMPILE_LANGUAGE:CXX>:-ffp-contract=off>)
  if(GENU_WARNINGS_AS_ERRORS)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  if(GENU_SANITIZE)
    # A finding ends the program, so that a test fails.
    target_compile_options(${target} PUBLIC -fsanitize=${GENU_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer)
    target_link_options(${target} PUBLIC -fsanitize=${GENU_SANITIZE})
  endif()
  if(GENU_BUILD_FUZZERS)
    target_compile_options(${target} PRIVATE -fsanitize=fuzzer-no-link) # coverage guides the fuzzer
  endif()
endfunction()

# genu_add_library(NAME [SOURCES ...] [PUBLIC ...] [PRIVATE ...]) adds library genu_NAME with alias Genu::NAME.
# Public headers live in include/ beside the calling CMakeLists.txt or one folder up.
function(genu_add_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  add_library(genu_${name} ${ARG_SOURCES})
  add_library(Genu::${name} ALIAS genu_${name})
  set_target_properties(genu_${name} PROPERTIES EXPORT_NAME ${name})
  set(include_dir ${CMAKE_CURRENT_SOURCE_DIR}/include)
  if(NOT EXISTS ${include_dir})
    set(include_dir ${CMAKE_CURRENT_SOURCE_DIR}/../include)
  endif()
  target_include_directories(genu_${name} PUBLIC
    $<BUILD_INTERFACE:${include_dir}>
    $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_link_libraries(genu_${name} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
  genu_configure_target(genu_${name})
  set(export GenuModelTargets)
  if(name STREQUAL contact)
    set(export GenuContactTargets)
  endif()
  install(TARGETS genu_${name} EXPORT ${export}
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
endfunction()

# genu_add_test(NAME LABEL [SOURCES ...] [LIBRARIES ...]) adds a GoogleTest program whose cases CTest sees one by one.
function(genu_add_test name label)
  cmake_parse_arguments(ARG "" "" "SOURCES;LIBRARIES;SLOW" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LIBRARIES} GTest::gtest_main GTest::gmock)
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR}/tests)
  target_compile_definitions(${name} PRIVATE GENU_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
  genu_configure_target(${name})
  set(filter)
  if(ARG_SLOW)
    string(REPLACE ";" ":" slow "${ARG_SLOW}")
    set(filter TEST_FILTER "*-${slow}")
    gtest_discover_tests(${name} DISCOVERY_TIMEOUT 60 TEST_FILTER "${slow}" TEST_LIST ${name}_SLOW PROPERTIES LABELS slow TIMEOUT 600)
  endif()
  gtest_discover_tests(${name} DISCOVERY_TIMEOUT 60 ${filter} PROPERTIES LABELS ${label} TIMEOUT 600)
endfunction()
