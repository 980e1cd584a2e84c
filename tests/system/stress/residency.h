#pragma once

#include <cstdint>
#include <string>

#include "absl/time/time.h"

namespace pepeseg {

struct ResidencyStressSettings {
  std::string worker;  // path of model_worker.cc's program
  int num_models = 20;
  // Number of models that fit the budget: each query in progress and the operator's pin hold one.
  int num_resident = 9;
  int num_threads = 8;  // threads that make queries
  absl::Duration duration;
};

struct ResidencyStressReport {
  int64_t num_queries = 0;
  int64_t num_wrong = 0;    // masks that differ from those of the model alone in memory
  int64_t num_failed = 0;   // calls with an error
  std::string first_error;  // the first of those errors
  int64_t num_loads = 0, num_evictions = 0;
  int64_t loads_of_first_queries =
      0;  // loads of one model by kNumFirstQueries simultaneous queries
  // The budget, and the maximum that was reserved and really allocated, bytes.
  int64_t limit = 0, peak_reserved = 0, peak_in_use = 0;
  int64_t left_reserved = 0, left_in_use = 0;  // bytes left after everything was unloaded
  int64_t num_samples = 0;
  // Resident bytes of the process: with no model in memory before and after, and the maximum
  // between.
  int64_t rss_before = 0, rss_peak = 0, rss_after = 0;

  std::string ToString() const;
};

inline constexpr int kNumFirstQueries = 100;

// Makes random queries of more models than fit, from several threads, to a server in this process,
// while models are sometimes loaded, unloaded, pinned and unpinned. Fails the calling test if the
// server cannot be set up.
ResidencyStressReport RunResidencyStress(const ResidencyStressSettings& settings);

}  // namespace pepeseg
