#pragma once

#include <filesystem>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/sfm/colmap_program.h"
#include "core/sfm/front/compare_photographs.h"
#include "core/sfm/sfm_options.h"
#include "core/sfm/sfm_watch.h"
#include "kernels/backend.h"

// The second step of stage "sfm": verified matches of pairs of photographs.
namespace pepeseg {

struct MatchingTask {
  std::filesystem::path database;      // with features; COLMAP writes its matches there
  std::filesystem::path own_database;  // created by the own front, with features and matches
  SfmLoad load;
  int num_threads = 0;  // 0: one for each core
};

// Matches the features of the database by the own front. Errors of CompareInDatabase and SfmWatch.
absl::StatusOr<ComparedDatabase> MatchByOwnFront(const MatchingTask& task,
                                                 const SfmOptions& options, Backend& backend,
                                                 SfmWatch& watch);

// Matches the features of the database by COLMAP's exhaustive or sequential matcher. Errors of
// SfmWatch::Run.
absl::Status MatchByColmap(const MatchingTask& task, const SfmOptions& options,
                           const ColmapProgram& program, SfmWatch& watch);

// Returns COLMAP's option for a number of threads; -1: one for each core.
std::string ColmapThreads(int num_threads);

}  // namespace pepeseg
