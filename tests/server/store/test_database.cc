#include "tests/server/store/test_database.h"

#include <fcntl.h>
#include <grp.h>
#include <pwd.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <vector>

#include "absl/strings/str_cat.h"
#include "server/store/soci.h"
#include "tests/testing/eventually.h"

namespace pepeseg::testing {
namespace {

// PostgreSQL refuses to run as root.
const passwd* OtherUser() { return geteuid() == 0 ? getpwnam("postgres") : nullptr; }

std::string FindPrograms() {
  for (const auto& version : std::filesystem::directory_iterator("/usr/lib/postgresql")) {
    if (access((version.path() / "bin/initdb").c_str(), X_OK) == 0) return version.path() / "bin";
  }
  return "";
}

pid_t Launch(std::vector<std::string> words, const std::filesystem::path& log) {
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  const passwd* user = OtherUser();
  const pid_t pid = fork();
  if (pid != 0) return pid;
  const int output = open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0666);
  dup2(output, STDOUT_FILENO);
  dup2(output, STDERR_FILENO);
  setpgid(0, 0);
  if (user != nullptr &&
      (setgroups(0, nullptr) != 0 || setgid(user->pw_gid) != 0 || setuid(user->pw_uid) != 0)) {
    _exit(126);
  }
  execv(argv[0], argv.data());
  _exit(127);
}

int WaitFor(pid_t pid) {
  int status = 0;
  waitpid(pid, &status, 0);
  return status;
}

}  // namespace

PostgresqlServer::PostgresqlServer() : programs_(FindPrograms()) {
  EXPECT_NE(programs_, "") << "PostgreSQL is not installed";
  std::filesystem::permissions(folder_.path(), std::filesystem::perms::all);
  if (const passwd* user = OtherUser()) {
    EXPECT_EQ(chown(folder_.path().c_str(), user->pw_uid, user->pw_gid), 0);
  }
  const int made =
      WaitFor(Launch({programs_ + "/initdb", "--pgdata", folder_ / "data", "--no-sync",
                      "--auth=trust", "--username=pepeseg", "--encoding=UTF8", "--locale=C"},
                     folder_ / "log"));
  EXPECT_EQ(made, 0) << "initdb: see " << folder_ / "log";
  Start();
}

PostgresqlServer::~PostgresqlServer() { StopNow(); }

std::string PostgresqlServer::Connection(const std::string& host) const {
  return absl::StrCat("host=", host.empty() ? folder_.path().string() : host,
                      " user=pepeseg dbname=postgres");
}

std::filesystem::path PostgresqlServer::socket() const { return folder_ / ".s.PGSQL.5432"; }

// Turns fsync off: these tests kill the process, not the machine. Recovery would otherwise begin
// with an fsync of a thousand files, which on a slow disk takes longer than a test waits.
//
// Starts the server again if it ends: after a crash it refuses to start until the last process of
// the one before, each of which is in a process group of its own, has seen the crash and ended.
void PostgresqlServer::Start() {
  const auto launch = [this] {
    return Launch({programs_ + "/postgres", "-D", folder_ / "data", "-k", folder_.path(), "-c",
                   "listen_addresses=", "-c", "max_connections=200", "-c", "fsync=off"},
                  folder_ / "log");
  };
  pid_ = launch();
  const auto answers = [&] {
    if (waitpid(pid_, nullptr, WNOHANG) == pid_) pid_ = launch();
    try {
      const soci::session sql(**PostgresqlBackend(), Connection());
      return true;
    } catch (const soci::soci_error&) {
      return false;
    }
  };
  EXPECT_TRUE(Eventually(answers)) << "PostgreSQL does not answer: see " << folder_ / "log";
}

void PostgresqlServer::StopNow() {
  if (pid_ == 0) return;
  kill(-pid_, SIGKILL);
  WaitFor(pid_);
  pid_ = 0;
}

void PostgresqlServer::Crash() { StopNow(); }

void PostgresqlServer::Restart() {
  std::error_code ignored;
  std::filesystem::remove(folder_ / "data" / "postmaster.pid", ignored);
  Start();
}

std::string PostgresqlServer::NewDatabase(const std::string& host) {
  const std::string name = absl::StrCat("t", ++num_databases_);
  soci::session sql(**PostgresqlBackend(), Connection());
  sql << "CREATE SCHEMA " << name;
  return absl::StrCat("postgresql:", Connection(host), " options='-c search_path=", name, "'");
}

bool TestsRunOnPostgresql() {
  const char* wanted = std::getenv("PEPESEG_TEST_DATABASE");
  return wanted != nullptr && std::string(wanted) == "postgresql";
}

std::string NewTestDatabase(const std::filesystem::path& folder) {
  static int num_databases = 0;
  if (!TestsRunOnPostgresql()) {
    return absl::StrCat("sqlite:",
                        (folder / absl::StrCat("store", ++num_databases, ".db")).string());
  }
  static PostgresqlServer server;
  return server.NewDatabase();
}

}  // namespace pepeseg::testing
