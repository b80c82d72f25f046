# find_package(Genu COMPONENTS contact model): `contact` needs Eigen alone, `contact_threads` oneTBB too; the others bring what they were
# built with.
include(CMakePackageConfigHelpers)

set(GENU_PACKAGE_DIR ${CMAKE_INSTALL_LIBDIR}/cmake/Genu)
configure_package_config_file(cmake/GenuConfig.cmake.in ${PROJECT_BINARY_DIR}/GenuConfig.cmake
  INSTALL_DESTINATION ${GENU_PACKAGE_DIR})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/GenuConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/GenuConfig.cmake ${PROJECT_BINARY_DIR}/GenuConfigVersion.cmake
  DESTINATION ${GENU_PACKAGE_DIR})

# One export file per component, so that a user of `contact` does not need Simbody to be installed.
install(EXPORT GenuContactTargets NAMESPACE Genu:: DESTINATION ${GENU_PACKAGE_DIR})
if(GENU_BUILD_MODEL)
  install(EXPORT GenuModelTargets NAMESPACE Genu:: DESTINATION ${GENU_PACKAGE_DIR})
endif()
install(FILES LICENSE NOTICE DESTINATION ${CMAKE_INSTALL_DOCDIR})
