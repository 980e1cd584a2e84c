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

// Results of scene lives (life_of_a_scene.h) on a server whose file accesses fail (io_faults.cc).
struct FaultReport {
  int64_t num_points = 0;  // calls that can be broken
  int64_t num_tried = 0;
  int64_t num_killed = 0;                // calls at which the server was killed
  std::map<std::string, int64_t> codes;  // number of lives under a fault that ended with each code
  std::map<std::string, std::string> examples;  // by code, the first fault and its message
  std::vector<std::string> broken, unclean;

  std::string ToString() const;
};

// Returns how often a server calls each of fsync, fdatasync, syncfs, rename and unlink on its data
// while `use` runs, without a fault.
std::map<std::string, int64_t> CountDurableCalls(
    const std::function<void(const std::shared_ptr<grpc::Channel>&)>& use);

// Runs two scene lives for each of the server's calls of fsync, fdatasync, syncfs, rename and
// unlink: the server is killed just before the call, and just after it. `stride`: tries every
// `stride`-th call.
FaultReport KillAtEveryDurableCall(int stride);

// Runs one life for each call from which on the disk is full. It ends with errors that say so, and
// continues when there is space again.
FaultReport FillDiskAtEveryCall(int stride);

// Runs one life for each call of read or pread, in which that call fails.
FaultReport FailEveryRead(int stride);

// Returns the environment of a pepesegd with PEPESEG_FAULT=`fault`; empty: without a fault.
std::vector<std::string> FaultEnvironment(const std::filesystem::path& data,
                                          const std::string& fault);

// Returns the paths in the lines of a trace that begin with one of `names`.
std::vector<std::string> TracedPaths(const std::filesystem::path& trace,
                                     const std::vector<std::string>& names);

}  // namespace pepeseg
