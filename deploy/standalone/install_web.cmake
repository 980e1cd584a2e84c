# Installs the web app, if it is built, with its launcher, unit and settings.
set(dist ${PEPESEG_ROOT}/clients/web/dist)
if(NOT EXISTS ${dist}/server/main.js OR NOT EXISTS ${dist}/app/index.html)
  if(CMAKE_INSTALL_COMPONENT STREQUAL "web")
    message(FATAL_ERROR "the web app is not built: run `make web-app` first")
  endif()
  message(STATUS "Not installed: the web app, which `make web-app` builds")
  return()
endif()
include(${PEPESEG_ROOT}/deploy/standalone/install_unit.cmake)
set(folder ${CMAKE_INSTALL_PREFIX}/share/pepeseg/web)
file(INSTALL ${dist}/app ${dist}/server DESTINATION ${folder})
# Node reads from it that main.js is an ES module.
file(WRITE $ENV{DESTDIR}${folder}/package.json "{\"type\": \"module\"}\n")
file(INSTALL ${PEPESEG_ROOT}/deploy/standalone/pepeseg-web DESTINATION ${CMAKE_INSTALL_PREFIX}/bin
     FILE_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ
                      WORLD_EXECUTE)
pepeseg_install_unit(pepeseg-web)
