#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "grpcpp/channel.h"

namespace pepeseg {

// What lives of scenes (life_of_a_scene.h) told whose server's files were made to fail
// (io_faults.cc).
struct FaultReport {
  int64_t num_points = 0;  // calls that can be broken
  int64_t num_tried = 0;
  int64_t num_killed = 0;                // of those, the server ended by it
  std::map<std::string, int64_t> codes;  // how often the life under the fault ended with each
  std::map<std::string, std::string> examples;  // by the code, the first fault and its message
  std::vector<std::string> broken, unclean;

  std::string ToString() const;
};

// How often a server without a fault calls each of fsync, fdatasync, syncfs, rename and unlink on
// its data while `use` uses it.
std::map<std::string, int64_t> CountDurableCalls(
    const std::function<void(const std::shared_ptr<grpc::Channel>&)>& use);

// One life of a scene for each of the server's calls of fsync, fdatasync, syncfs, rename and
// unlink, in which it is killed just before that call, and one just after it. `stride`: tries every
// so many.
FaultReport KillAtEveryDurableCall(int stride);

// One life for each call from which on the disk is full: it ends in errors that say so, and goes on
// when there is space again.
FaultReport FillDiskAtEveryCall(int stride);

// One life for each call of read or pread, of which that one fails.
FaultReport FailEveryRead(int stride);

// The environment of a pepesegd under PEPESEG_FAULT=`fault`; empty: under none.
std::vector<std::string> FaultEnvironment(const std::filesystem::path& data,
                                          const std::string& fault);

// Lines of a trace that begin with one of `names`, without it: paths.
std::vector<std::string> TracedPaths(const std::filesystem::path& trace,
                                     const std::vector<std::string>& names);

}  // namespace pepeseg
