# What `cmake --install` copies, by component:
#   server  pepesegd, pepeseg-worker, their modules, scripts for operators, the unit of systemd
#   client  pepeseg, its completions, the contract's files
#   web     the web app, which `make web-app` builds, its launcher and its unit
#   dev     the C++ client library (clients/cpp/CMakeLists.txt)
# A tree may be moved after it was installed, except for its units, which name paths.
install(TARGETS pepesegd pepeseg-worker COMPONENT server DESTINATION ${CMAKE_INSTALL_BINDIR})
install(TARGETS pepeseg COMPONENT client DESTINATION ${CMAKE_INSTALL_BINDIR})
install(DIRECTORY proto/pepeseg COMPONENT client DESTINATION ${CMAKE_INSTALL_DATADIR}/pepeseg/proto
        FILES_MATCHING PATTERN "*.proto")
install(PROGRAMS deploy/backup.sh deploy/restore.sh deploy/certificates.sh deploy/token.sh
                 deploy/sam.sh deploy/detector.sh
        COMPONENT server DESTINATION ${CMAKE_INSTALL_DATADIR}/pepeseg/deploy)
install(FILES deploy/npm_files.sh deploy/graph_model_to_onnx.py
        COMPONENT server DESTINATION ${CMAKE_INSTALL_DATADIR}/pepeseg/deploy)

# Manual pages: the texts of deploy/manuals with the options that `--help` prints.
find_package(Python3 REQUIRED COMPONENTS Interpreter)
set(documents "")
foreach(manual pepesegd:server pepeseg-worker:server pepeseg:client pepeseg-web:web)
  string(REGEX MATCH "^(.*):(.*)$" manual ${manual})
  set(name ${CMAKE_MATCH_1})
  set(component ${CMAKE_MATCH_2})
  set(page ${CMAKE_BINARY_DIR}/share/man/man1/${name}.1)
  set(help ${CMAKE_SOURCE_DIR}/clients/web/server/config.ts)  # has the text of pepeseg-web --help
  if(TARGET ${name})
    set(help $<TARGET_FILE:${name}>)
  endif()
  set(files ${CMAKE_SOURCE_DIR}/deploy/manuals/make_manual.py
      ${CMAKE_SOURCE_DIR}/deploy/manuals/${name}.1.in ${help})
  add_custom_command(OUTPUT ${page} DEPENDS ${files} VERBATIM
    COMMAND ${Python3_EXECUTABLE} ${files} ${page} ${PROJECT_VERSION})
  install(FILES ${page} COMPONENT ${component} DESTINATION ${CMAKE_INSTALL_MANDIR}/man1)
  list(APPEND documents ${page})
endforeach()

set(bash_completion ${CMAKE_BINARY_DIR}/share/bash-completion/pepeseg)
set(zsh_completion ${CMAKE_BINARY_DIR}/share/zsh/_pepeseg)
file(MAKE_DIRECTORY ${CMAKE_BINARY_DIR}/share/bash-completion ${CMAKE_BINARY_DIR}/share/zsh)
add_custom_command(OUTPUT ${bash_completion} ${zsh_completion} DEPENDS pepeseg VERBATIM
  COMMAND sh -c [["$0" completion bash >"$1" && "$0" completion zsh >"$2"]]
    $<TARGET_FILE:pepeseg> ${bash_completion} ${zsh_completion})
install(FILES ${bash_completion} COMPONENT client
        DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions)
install(FILES ${zsh_completion} COMPONENT client
        DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/site-functions)
list(APPEND documents ${bash_completion} ${zsh_completion})
add_custom_target(documents ALL DEPENDS ${documents})

install(CODE "set(PEPESEG_ROOT \"${CMAKE_SOURCE_DIR}\")" ALL_COMPONENTS)
install(SCRIPT deploy/standalone/install_server.cmake COMPONENT server)
install(SCRIPT deploy/standalone/install_web.cmake COMPONENT web)
