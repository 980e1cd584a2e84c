#pragma once

#include <cstdint>
#include <string>

#include "absl/time/time.h"

namespace pepeseg {

struct ResidencyStressSettings {
  std::string worker;  // model_worker.cc
  int num_models = 20;
  int num_resident = 5;  // for how many the budget is
  int num_threads = 8;   // that ask
  absl::Duration duration;
};

struct ResidencyStressReport {
  int64_t num_queries = 0;
  int64_t num_wrong = 0;    // masks other than those of a model alone in memory
  int64_t num_failed = 0;   // calls with an error
  std::string first_error;  // of those
  int64_t num_loads = 0, num_evictions = 0;
  int64_t loads_of_first_queries = 0;  // of one model, by kNumFirstQueries at the same time
  // Bytes: the budget, and the most of it that was seen reserved and really allocated.
  int64_t limit = 0, peak_reserved = 0, peak_in_use = 0;
  int64_t left_reserved = 0, left_in_use = 0;  // when everything was unloaded
  int64_t num_samples = 0;
  // Of the process: with no model in memory before and after, and the most in between.
  int64_t rss_before = 0, rss_peak = 0, rss_after = 0;

  std::string ToString() const;
};

inline constexpr int kNumFirstQueries = 100;

// Random questions to more models than fit, from several threads, to a server in this process,
// while models are loaded, unloaded, pinned and unpinned now and then. Fails the calling test where
// the server cannot be set up.
ResidencyStressReport RunResidencyStress(const ResidencyStressSettings& settings);

}  // namespace pepeseg
