function(run)
  execute_process(COMMAND ${ARGV} RESULT_VARIABLE result)
  if(NOT result EQUAL 0)
    message(FATAL_ERROR "failed (${result}): ${ARGV}")
  endif()
endfunction()

file(REMOVE_RECURSE ${WORK_DIR})
run(${CMAKE_COMMAND} --install ${GENU_BINARY_DIR} --prefix ${WORK_DIR}/prefix)
set(flags "")
if(SANITIZE)
  set(flags "-fsanitize=${SANITIZE}")
endif()
run(${CMAKE_COMMAND} -S ${CONSUMER_SOURCE_DIR} -B ${WORK_DIR}/build -G ${GENERATOR} -DCMAKE_BUILD_TYPE=${CONFIG}
    -DCMAKE_CXX_COMPILER=${COMPILER} -DCMAKE_PREFIX_PATH=${WORK_DIR}/prefix -DCMAKE_CXX_FLAGS=${flags}
    -DUSE_THREADS=${THREADS})
run(${CMAKE_COMMAND} --build ${WORK_DIR}/build)
run(${WORK_DIR}/build/use_contact)
run(${WORK_DIR}/build/use_model)
if(THREADS)
  run(${WORK_DIR}/build/use_threads)
endif()
# The installed program finds the libraries beside it.
run(${WORK_DIR}/prefix/bin/genu --version)

# A component that does not exist must be refused by name.
file(WRITE ${WORK_DIR}/refused/CMakeLists.txt
  "cmake_minimum_required(VERSION 3.25)\nproject(Refused CXX)\nfind_package(Genu REQUIRED COMPONENTS nonsense)\n")
execute_process(COMMAND ${CMAKE_COMMAND} -S ${WORK_DIR}/refused -B ${WORK_DIR}/refused/build -G ${GENERATOR}
    -DCMAKE_CXX_COMPILER=${COMPILER} -DCMAKE_PREFIX_PATH=${WORK_DIR}/prefix
  RESULT_VARIABLE result ERROR_VARIABLE errors OUTPUT_QUIET)
if(result EQUAL 0 OR NOT errors MATCHES "nonsense")
  message(FATAL_ERROR "a missing component was not refused by name: ${errors}")
endif()
