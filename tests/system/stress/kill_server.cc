#include "tests/system/stress/kill_server.h"

#include <atomic>
#include <csignal>
#include <memory>
#include <mutex>
#include <random>
#include <thread>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "tests/server/pepesegd_process.h"
#include "tests/system/stress/life_of_a_scene.h"
#include "tests/system/stress/unclean_data.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using testing::PepesegdOptions;
using testing::PepesegdProcess;

PepesegdOptions Options(std::vector<std::string> environment = {}) {
  return {{}, std::move(environment), PEPESEG_MODEL_WORKER, "", /*may_end=*/true};
}

// A server that runs, is killed, or is starting. Thread safe.
class MortalServer {
 public:
  explicit MortalServer(std::filesystem::path data) : data_(std::move(data)) { Start(); }

  std::shared_ptr<grpc::Channel> channel() {
    const std::lock_guard lock(mutex_);
    return channel_;
  }
  void Kill() { process_->Kill(); }
  void Start() {
    const absl::Time begin = absl::Now();
    process_ = std::make_unique<PepesegdProcess>(data_, Options());
    slowest_start_ = std::max(slowest_start_, absl::Now() - begin);
    const std::lock_guard lock(mutex_);
    channel_ = process_->channel();
  }
  bool Stop() {
    const auto end = process_->Terminate();
    return end.has_value() && end->exit_code == 0 && end->signal == 0;
  }
  absl::Duration slowest_start() const { return slowest_start_; }

 private:
  const std::filesystem::path data_;
  std::unique_ptr<PepesegdProcess> process_;  // used by the thread that kills
  absl::Duration slowest_start_;
  std::mutex mutex_;
  std::shared_ptr<grpc::Channel> channel_;
};

// Runs a life, and resumes it each time the server is lost. Returns false if an answer was wrong.
bool LiveOn(LifeOfAScene& life, MortalServer& server, const std::atomic<bool>& end,
            std::string* wrong) {
  while (!life.done()) {
    const absl::Status status = life.Run(server.channel());
    const bool lost = absl::IsUnavailable(status) || absl::IsCancelled(status) ||
                      absl::IsDeadlineExceeded(status);
    if (!status.ok() && !lost) {
      *wrong = status.ToString();
      return false;
    }
    if (end && !status.ok()) return true;
    if (!status.ok()) absl::SleepFor(absl::Milliseconds(20));
  }
  return true;
}

}  // namespace

std::string KillServerReport::ToString() const {
  return absl::StrCat(num_kills, " kills, ", num_lives, " lives of scenes, slowest start ",
                      absl::FormatDuration(slowest_start), "; broken: ", broken.size(), " ",
                      absl::StrJoin(broken, "; "), "; unclean: ", unclean.size(), " ",
                      absl::StrJoin(unclean, "; "));
}

KillServerReport KillServerAgainAndAgain(int num_kills, int num_clients) {
  const testing::TempFolder folder;
  MortalServer server(folder / "data");
  KillServerReport report;
  std::mutex mutex;
  std::vector<std::unique_ptr<LifeOfAScene>> lives;
  std::atomic<bool> end = false;
  std::vector<std::thread> clients;
  for (int client = 0; client < num_clients; ++client) {
    clients.emplace_back([&, client] {
      for (int i = 0; !end; ++i) {
        auto life = std::make_unique<LifeOfAScene>(absl::StrCat("c", client, "-", i));
        std::string wrong;
        const bool good = LiveOn(*life, server, end, &wrong);
        const std::lock_guard lock(mutex);
        if (!good) report.broken.push_back(wrong);
        lives.push_back(std::move(life));
        if (!good) return;
      }
    });
  }
  std::mt19937 random(1);  // the moments differ in each run in spite of the fixed seed
  for (; report.num_kills < num_kills; ++report.num_kills) {
    absl::SleepFor(absl::Milliseconds(std::uniform_int_distribution<int>(10, 900)(random)));
    server.Kill();
    server.Start();
  }
  end = true;
  for (std::thread& client : clients) client.join();
  // Lives that were in progress at the end are also checked.
  const std::atomic<bool> never = false;
  for (const auto& life : lives) {
    std::string wrong;
    if (!LiveOn(*life, server, never, &wrong)) report.broken.push_back(wrong);
    if (const absl::Status kept = life->Check(server.channel()); !kept.ok()) {
      report.broken.push_back(kept.ToString());
    }
  }
  report.num_lives = static_cast<int64_t>(lives.size());
  report.slowest_start = server.slowest_start();
  if (!server.Stop()) report.broken.push_back("the server did not stop cleanly");
  report.unclean = FindUnclean(folder / "data");
  return report;
}

}  // namespace pepeseg
