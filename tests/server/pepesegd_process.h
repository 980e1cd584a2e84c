#pragma once

#include <grpcpp/grpcpp.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/jobs/process.h"

namespace pepeseg::testing {

// The server program itself, on a free port of this machine. Killed with the object.
class PepesegdProcess {
 public:
  // Waits until it answers. The data directory may be one that an earlier server left.
  // `more`: further arguments.
  explicit PepesegdProcess(const std::filesystem::path& data,
                           const std::vector<std::string>& more = {});

  std::shared_ptr<grpc::Channel> channel() const { return channel_; }
  bool alive() { return process_ != nullptr && !process_->Poll().has_value(); }
  pid_t pid() const { return process_->pid(); }
  std::string Log() const;

  // SIGTERM, and its exit status; none: it did not end within 30 s.
  std::optional<WorkerProcess::End> Terminate();
  void Kill();

 private:
  std::filesystem::path log_;
  std::unique_ptr<WorkerProcess> process_;
  std::shared_ptr<grpc::Channel> channel_;
};

// Process whose command line has `word`; 0: there is none.
pid_t FindProcess(const std::string& word);

}  // namespace pepeseg::testing
