#pragma once

#include <map>
#include <mutex>
#include <string>

#include "absl/status/status.h"
#include "absl/time/time.h"

namespace pepeseg {

// Remembers for ten minutes which photographs did not decode, so that asking for one again does not
// take a decoder again. Not for longer, since a decoder may also have been too slow because the
// machine was busy. Thread safe.
class FailedPhotographs {
 public:
  // Returns the error of an attempt that Remember() was given, or OK.
  absl::Status Find(const std::string& key, absl::Time now) const;
  // `key`: the file's digest, and the task's other inputs that the error may depend on.
  void Remember(const std::string& key, const absl::Status& error, absl::Time now);

 private:
  struct Failure {
    absl::Status error;
    absl::Time when;
  };

  mutable std::mutex mutex_;
  std::map<std::string, Failure> failures_;  // guarded by mutex_
};

}  // namespace pepeseg
