#pragma once

#include <grpcpp/grpcpp.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/jobs/launcher.h"

namespace pepeseg::testing {

struct PepesegdOptions {
  std::vector<std::string> arguments;    // in addition to the usual ones
  std::vector<std::string> environment;  // "NAME=VALUE"
  std::filesystem::path worker;          // empty: pepeseg-worker
  std::string name;                      // distinguishes servers on one data directory
  bool may_end = false;                  // whether it may end before it answers
  std::string listen = "127.0.0.1:0";
  std::shared_ptr<grpc::ChannelCredentials> credentials = nullptr;  // none: not encrypted
};

// The server program, on a free port of this machine. The destructor kills it.
class PepesegdProcess {
 public:
  // Starts the program and waits until it answers. An earlier server may have used the directory.
  PepesegdProcess(const std::filesystem::path& data, const PepesegdOptions& options);
  explicit PepesegdProcess(const std::filesystem::path& data,
                           const std::vector<std::string>& more = {})
      : PepesegdProcess(data, PepesegdOptions{more, {}, {}, {}, false}) {}

  std::shared_ptr<grpc::Channel> channel() const { return channel_; }
  bool alive() { return process_ != nullptr && !process_->Poll().has_value(); }
  pid_t pid() const { return process_->pid(); }
  std::string Log() const;

  // Sends SIGTERM and returns the exit status; nothing if it did not end within 30 s.
  std::optional<WorkerEnd> Terminate();
  void Kill();
  void Signal(int signal) const { process_->Signal(signal); }

 private:
  std::filesystem::path log_;
  std::unique_ptr<WorkerProcess> process_;
  std::shared_ptr<grpc::Channel> channel_;
};

// Returns the id of a process whose command line contains `word`; 0: there is none.
pid_t FindProcess(const std::string& word);

}  // namespace pepeseg::testing
