#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "pepeseg/v1/job_service.pb.h"
#include "server/store/records.h"
#include "server/store/store.h"

namespace pepeseg {

// Fills in what queued jobs wait for (v1::Job::wait). For one thread and one answer: it reads the
// queue once, and not at all if no job is queued.
class JobWaits {
 public:
  // Must outlive it.
  explicit JobWaits(Store& store) : store_(store) {}
  // Sets `job`, which was made from `record`. If the queue cannot be read there is no wait: an
  // answer without it is better than none.
  void Fill(const JobRecord& record, v1::Job& job);

 private:
  Store& store_;
  std::optional<std::vector<int64_t>> claimable_;  // see JobQueue::ListClaimable
};

}  // namespace pepeseg
