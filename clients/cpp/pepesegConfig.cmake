include(CMakeFindDependencyMacro)
find_dependency(Threads)
find_dependency(absl)
find_dependency(OpenSSL)
# Find Protobuf in module mode first: Debian 12 ships no config for it, and gRPC's config would look
# for one.
find_dependency(Protobuf)
find_dependency(gRPC CONFIG)
include(${CMAKE_CURRENT_LIST_DIR}/pepesegTargets.cmake)
