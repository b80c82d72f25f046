# Configures the program without its optional libraries, in a folder of its own, and looks through everything that would be linked.
file(REMOVE_RECURSE ${WORK_DIR})
execute_process(COMMAND ${CMAKE_COMMAND} -S ${SOURCE_DIR} -B ${WORK_DIR} -G ${GENERATOR} -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_COMPILER=${COMPILER}
    -DGENU_WITH_SUNDIALS=OFF -DGENU_WITH_CONTACT_THREADS=OFF -DGENU_BUILD_TESTS=OFF
  RESULT_VARIABLE result OUTPUT_QUIET)
if(NOT result EQUAL 0)
  message(FATAL_ERROR "cmake without SUNDIALS and threads failed (${result})")
endif()
file(GLOB_RECURSE files ${WORK_DIR}/build.ninja ${WORK_DIR}/link.txt)
set(linked "")
foreach(file IN LISTS files)
  file(READ ${file} text)
  string(APPEND linked "${text}")
endforeach()
if(NOT linked MATCHES "libSimTKsimbody") # what is there for certain
  message(FATAL_ERROR "no link lines found in ${WORK_DIR}")
endif()
string(REGEX MATCHALL "(libsundials|libgenu_sundials|libgenu_contact_threads|libtbb|libTK[A-Z]|libvtk)[A-Za-z0-9_.]*" found "${linked}")
list(REMOVE_DUPLICATES found)
if(found)
  message(FATAL_ERROR "built without SUNDIALS and threads, and yet linked: ${found}")
endif()
