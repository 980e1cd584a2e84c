#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "tests/testing/temp_folder.h"

namespace pepeseg::testing {

// A proxy between clients and a PostgreSQL server, on a socket of its own. It cuts a connection at
// a COMMIT: before the server receives it, or after the server has committed and before the client
// gets the answer. Thread safe.
class CommitCutter {
 public:
  enum class Cut { kBefore, kAfter };

  // `socket`: the server's.
  explicit CommitCutter(std::filesystem::path socket);
  ~CommitCutter();
  CommitCutter(const CommitCutter&) = delete;
  CommitCutter& operator=(const CommitCutter&) = delete;

  // Returns the value of libpq's "host" for clients.
  std::string host() const { return folder_.path(); }

  // Cuts at the `number`th COMMIT from now on, counted from 1. 0: never.
  void Arm(int64_t number, Cut cut);
  // Returns the number of COMMITs since Arm.
  int64_t num_commits() const { return num_commits_; }
  bool has_cut() const { return has_cut_; }

 private:
  struct Pair {
    int client = -1, server = -1;
  };
  void Accept();
  void Serve(Pair pair);
  // Forwards the whole messages that a client has sent. Returns false if the connection must end.
  bool Forward(const Pair& pair, std::string& pending, bool& started);

  const TempFolder folder_;
  const std::filesystem::path socket_;
  int listener_ = -1;
  std::atomic<bool> stopping_ = false;
  std::atomic<int64_t> num_commits_ = 0, armed_ = 0;
  std::atomic<Cut> cut_ = Cut::kBefore;
  std::atomic<bool> has_cut_ = false;
  std::mutex mutex_;  // guards connections_
  std::vector<std::thread> connections_;
  std::thread acceptor_;
};

}  // namespace pepeseg::testing
