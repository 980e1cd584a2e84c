#pragma once

#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <string>

#include "server/jobs/supervisor.h"

namespace pepeseg {

// The watches of jobs. Thread safe. A watch may outlive the list, as they share the entries.
class WatchList {
 public:
  WatchList() : entries_(std::make_shared<Entries>()) {}

  std::unique_ptr<Supervisor::Watch> Add(const std::string& job, std::function<void()> changed);
  // Calls `changed` of each watch of `job`; empty: of all watches.
  void Notify(const std::string& job) const;

 private:
  struct Entry {
    std::string job;
    std::function<void()> changed;
  };
  struct Entries {
    std::mutex mutex;  // held while calling, so that no watch is called after its destructor
    std::list<Entry> list;
  };
  class Held;

  std::shared_ptr<Entries> entries_;
};

}  // namespace pepeseg
