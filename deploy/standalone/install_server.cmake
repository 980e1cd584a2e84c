# Installs the server's unit, settings, user and folders, for systemd.
include(${PEPESEG_ROOT}/deploy/standalone/install_unit.cmake)
pepeseg_install_unit(pepesegd)
file(INSTALL ${PEPESEG_ROOT}/deploy/standalone/sysusers.conf RENAME pepeseg.conf
     DESTINATION ${CMAKE_INSTALL_PREFIX}/lib/sysusers.d)
file(INSTALL ${PEPESEG_ROOT}/deploy/standalone/tmpfiles.conf RENAME pepeseg.conf
     DESTINATION ${CMAKE_INSTALL_PREFIX}/lib/tmpfiles.d)
