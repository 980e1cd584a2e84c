#pragma once

#include <grpcpp/grpcpp.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/jobs/process.h"

namespace pepeseg::testing {

struct PepesegdOptions {
  std::vector<std::string> arguments;    // beside the usual ones
  std::vector<std::string> environment;  // "NAME=VALUE"
  std::filesystem::path worker;          // empty: pepeseg-worker
  std::string name;                      // tells servers on one data directory apart
  bool may_end = false;                  // before it answers: that is what is tried
  std::string listen = "127.0.0.1:0";
  std::shared_ptr<grpc::ChannelCredentials> credentials = nullptr;  // none: not encrypted
};

// The server program itself, on a free port of this machine. Killed with the object.
class PepesegdProcess {
 public:
  // Waits until it answers. The data directory may be one that an earlier server left.
  PepesegdProcess(const std::filesystem::path& data, const PepesegdOptions& options);
  explicit PepesegdProcess(const std::filesystem::path& data,
                           const std::vector<std::string>& more = {})
      : PepesegdProcess(data, PepesegdOptions{more, {}, {}, {}, false}) {}

  std::shared_ptr<grpc::Channel> channel() const { return channel_; }
  bool alive() { return process_ != nullptr && !process_->Poll().has_value(); }
  pid_t pid() const { return process_->pid(); }
  std::string Log() const;

  // SIGTERM, and its exit status; none: it did not end within 30 s.
  std::optional<WorkerEnd> Terminate();
  void Kill();
  void Signal(int signal) const { process_->Signal(signal); }

 private:
  std::filesystem::path log_;
  std::unique_ptr<WorkerProcess> process_;
  std::shared_ptr<grpc::Channel> channel_;
};

// Process whose command line has `word`; 0: there is none.
pid_t FindProcess(const std::string& word);

}  // namespace pepeseg::testing
