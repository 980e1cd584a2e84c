#pragma once

#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "pepeseg/v1/job_service.pb.h"
#include "server/store/records.h"

namespace pepeseg {

// What the supervisor's thread reports about jobs to other threads: the newest event of each job
// that runs here, the obstacles, and the calls of watches. Thread safe. No function waits for the
// store or the disk.
class JobFeed {
 public:
  struct Newest {
    int64_t sequence = 0;                     // number of the job's newest event; 0: there is none
    std::optional<v1::JobProgress> progress;  // the newest one among its events
  };
  // Is destroyed to end the calls.
  class Watch {
   public:
    virtual ~Watch() = default;
  };

  JobFeed() : watches_(std::make_shared<Watches>()) {}

  void SetNewest(const std::string& job, const Newest& newest);
  // Returns the newest event of a job that runs here; none: it does not.
  std::optional<Newest> FindNewest(const std::string& job) const;

  // Records that `error` has stopped the start or the end of `job`, and notifies its watches. An
  // empty `job` stands for every queued job.
  void SetObstacle(const std::string& job, const absl::Status& error);
  void ClearObstacle(const std::string& job);
  // See Supervisor::FindObstacle.
  absl::Status FindObstacle(const std::string& job, bool queued) const;
  // Removes the obstacles of all jobs that are not in `held`, except the one of the queue.
  void KeepObstaclesOf(const std::vector<JobRecord>& held);

  // Removes the newest event and the obstacle of a job that no longer runs here.
  void Forget(const std::string& job);

  // See Supervisor::AddWatch. A watch may outlive the feed, since both own the list of watches.
  std::unique_ptr<Watch> AddWatch(const std::string& job, std::function<void()> changed);
  // Calls `changed` of each watch of `job`; of all watches if `job` is empty.
  void Notify(const std::string& job) const;

 private:
  struct WatchEntry {
    std::string job;
    std::function<void()> changed;
  };
  struct Watches {
    std::mutex mutex;  // held during calls, so that no watch is called after its destructor
    std::list<WatchEntry> list;
  };
  class HeldWatch;

  mutable std::mutex mutex_;  // guards newest_ and obstacles_; never held together with a watch's
  std::map<std::string, Newest> newest_;
  std::map<std::string, absl::Status> obstacles_;  // by job; "": of the queue
  const std::shared_ptr<Watches> watches_;
};

}  // namespace pepeseg
