#pragma once

#include <condition_variable>
#include <list>
#include <mutex>
#include <span>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/decompose/decompose.h"

namespace pepeseg {

// The last decompositions of a model that were asked for, by their scales: each is made once,
// however many ask for it at the same time. Thread safe.
class Decompositions {
 public:
  static constexpr int kMostKept = 4;
  using Make = absl::FunctionRef<absl::StatusOr<Decomposition>()>;
  using Use = absl::FunctionRef<absl::Status(const Decomposition&)>;

  // What `use` answers, called with the decomposition at these scales, which does not go meanwhile.
  // Without one `make` is called first, while others can use the ones that there are. Its error is
  // answered to who called; others who waited for it try again.
  absl::Status With(std::span<const double> scales, Make make, Use use);

 private:
  struct Entry {
    std::vector<double> scales;
    Decomposition decomposition;
    bool ready = false;
    int num_users = 0;
  };
  using Entries = std::list<Entry>;

  Entries::iterator Find(std::span<const double> scales);
  // With the mutex held by `lock`; released while `make` runs.
  absl::StatusOr<Entries::iterator> Get(std::span<const double> scales, Make make,
                                        std::unique_lock<std::mutex>& lock);
  void DropOldest();

  std::mutex mutex_;
  std::condition_variable made_;
  Entries entries_;  // the last used first
};

}  // namespace pepeseg
