include(CMakeFindDependencyMacro)
find_dependency(Threads)
find_dependency(absl)
find_dependency(OpenSSL)
# Module mode first: Debian 12 ships no Protobuf config, and gRPC's own would look for one.
find_dependency(Protobuf)
find_dependency(gRPC CONFIG)
include(${CMAKE_CURRENT_LIST_DIR}/pepesegTargets.cmake)
