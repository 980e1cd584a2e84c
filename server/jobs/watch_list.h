#pragma once

#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <string>

#include "server/jobs/supervisor.h"

namespace pepeseg {

// Who wants to know of which job. Thread safe; outlives its watches because they share its state.
class WatchList {
 public:
  WatchList() : entries_(std::make_shared<Entries>()) {}

  std::unique_ptr<Supervisor::Watch> Add(const std::string& job, std::function<void()> changed);
  // Calls `changed` of everyone who watches `job`; empty: of everyone.
  void Notify(const std::string& job) const;

 private:
  struct Entry {
    std::string job;
    std::function<void()> changed;
  };
  struct Entries {
    std::mutex mutex;  // held while calling, so that a watch that is gone is not called any more
    std::list<Entry> list;
  };
  class Held;

  std::shared_ptr<Entries> entries_;
};

}  // namespace pepeseg
