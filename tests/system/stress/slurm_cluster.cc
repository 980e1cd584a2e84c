#include "tests/system/stress/slurm_cluster.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <random>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/time/clock.h"
#include "tests/testing/eventually.h"

namespace pepeseg::testing {
namespace {

constexpr const char* kPrograms[] = {"/usr/sbin/slurmctld", "/usr/sbin/slurmd", "/usr/bin/sbatch",
                                     "/usr/sbin/munged"};

int FreePort() {
  const int listener = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(address);
  EXPECT_EQ(bind(listener, reinterpret_cast<sockaddr*>(&address), size), 0);
  EXPECT_EQ(getsockname(listener, reinterpret_cast<sockaddr*>(&address), &size), 0);
  close(listener);
  return ntohs(address.sin_port);
}

std::string HostName() {
  char name[256] = "";
  gethostname(name, sizeof(name) - 1);
  return std::string(absl::string_view(name).substr(0, absl::string_view(name).find('.')));
}

}  // namespace

bool SlurmCluster::IsInstalled() {
  for (const char* program : kPrograms) {
    if (access(program, X_OK) != 0) return false;
  }
  return geteuid() == 0;
}

SlurmCluster::SlurmCluster(int num_nodes) {
  for (const char* name : {"state", "spool", "log"}) {
    std::filesystem::create_directories(folder_ / name);
  }
  std::ofstream key(folder_ / "munge.key", std::ios::binary);
  std::random_device random;
  for (int i = 0; i < 64; ++i) {
    const unsigned int word = random();
    key.write(reinterpret_cast<const char*>(&word), sizeof(word));
  }
  key.close();
  std::filesystem::permissions(folder_ / "munge.key", std::filesystem::perms::owner_read);
  WriteConfiguration(num_nodes);
  daemons_.push_back(Launch({"/usr/sbin/munged", "--foreground", "--force",
                             "--socket=" + (folder_ / "munge.socket").string(),
                             "--key-file=" + (folder_ / "munge.key").string(),
                             "--log-file=" + (folder_ / "log/munged").string(),
                             "--pid-file=" + (folder_ / "munged.pid").string(),
                             "--seed-file=" + (folder_ / "munged.seed").string()},
                            "munged"));
  EXPECT_TRUE(testing::Eventually([&] {
    return std::filesystem::exists(folder_ / "munge.socket");
  })) << "munged does not listen";
  const std::string conf = folder_ / "slurm.conf";
  daemons_.push_back(Launch({"/usr/sbin/slurmctld", "-D", "-f", conf}, "slurmctld"));
  for (int i = 0; i < num_nodes; ++i) {
    const std::string name = absl::StrCat("n", i + 1);
    nodes_.emplace_back(name, Launch({"/usr/sbin/slurmd", "-D", "-N", name, "-f", conf}, name));
  }
  EXPECT_TRUE(testing::Eventually([&] {
    const std::vector<std::string> idle =
        absl::StrSplit(Ask("sinfo -h -N -t idle -o %N"), '\n', absl::SkipEmpty());
    return static_cast<int>(idle.size()) == num_nodes;
  })) << "the nodes are not ready: "
      << Ask("sinfo -N -l 2>&1; tail -n 20 " + (folder_ / "log").string() + "/*");
}

SlurmCluster::~SlurmCluster() {
  for (const auto& [name, pid] : nodes_) kill(-pid, SIGKILL);
  for (const pid_t pid : daemons_) kill(-pid, SIGKILL);
  while (waitpid(-1, nullptr, WNOHANG) > 0) {
  }
}

void SlurmCluster::WriteConfiguration(int num_nodes) {
  const std::string host = HostName();
  std::ofstream conf(folder_ / "slurm.conf");
  conf << "ClusterName=pepeseg\nSlurmctldHost=" << host << "(127.0.0.1)\nSlurmUser=root\n"
       << "SlurmctldPort=" << FreePort() << "\nAuthType=auth/munge\n"
       << "AuthInfo=socket=" << (folder_ / "munge.socket").string() << "\n"
       << "StateSaveLocation=" << (folder_ / "state").string() << "\n"
       << "SlurmdSpoolDir=" << (folder_ / "spool").string() << "/%n\n"
       << "SlurmctldPidFile=" << (folder_ / "slurmctld.pid").string() << "\n"
       << "SlurmdPidFile=" << (folder_ / "slurmd-%n.pid").string() << "\n"
       << "ProctrackType=proctrack/linuxproc\nTaskPlugin=task/none\n"
       << "SelectType=select/cons_tres\nSelectTypeParameters=CR_Core\n"
       << "JobAcctGatherType=jobacct_gather/none\nMpiDefault=none\n"
       << "SlurmdTimeout=5\nInactiveLimit=0\nKillWait=5\nReturnToService=2\n"
       << "SchedulerParameters=sched_interval=1,bf_interval=1,batch_sched_delay=0\n"
       << "SlurmdParameters=config_overrides\nMinJobAge=300\n";
  for (int i = 0; i < num_nodes; ++i) {
    conf << "NodeName=n" << i + 1 << " NodeHostname=" << host
         << " NodeAddr=127.0.0.1 Port=" << FreePort() << " CPUs=2 RealMemory=16000\n";
  }
  conf << "PartitionName=train Nodes=n[1-" << num_nodes
       << "] Default=YES MaxTime=INFINITE State=UP\n";
}

pid_t SlurmCluster::Launch(const std::vector<std::string>& words, const std::string& log) {
  std::vector<std::string> copies = words;
  std::vector<char*> argv;
  for (std::string& word : copies) argv.push_back(word.data());
  argv.push_back(nullptr);
  const std::string path = folder_ / "log" / log;
  const pid_t pid = fork();
  if (pid != 0) return pid;
  const int output = open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0644);
  dup2(output, STDOUT_FILENO);
  dup2(output, STDERR_FILENO);
  setpgid(0, 0);
  execv(argv[0], argv.data());
  _exit(127);
}

std::string SlurmCluster::Ask(const std::string& command) const {
  const std::string whole = environment() + " " + command;
  FILE* pipe = popen(whole.c_str(), "r");
  if (pipe == nullptr) return "";
  std::string answer;
  char bytes[4096];
  for (size_t size = 0; (size = fread(bytes, 1, sizeof(bytes), pipe)) > 0;) {
    answer.append(bytes, size);
  }
  pclose(pipe);
  return answer;
}

std::string SlurmCluster::NodeOf(const std::string& job_name) const {
  const std::string answer = Ask("squeue -h -t RUNNING -n " + job_name + " -o %N");
  return answer.substr(0, answer.find('\n'));
}

void SlurmCluster::KillNode(const std::string& node) {
  for (const auto& [name, pid] : nodes_) {
    if (name == node) kill(-pid, SIGKILL);
  }
  // Finds what runs on the node: jobs, which have its name in their environment, and the step
  // daemons, their parents. The daemons are killed first, or they would report how the jobs ended.
  std::vector<pid_t> daemons, jobs;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator("/proc", error)) {
    const std::string pid = entry.path().filename();
    if (pid.find_first_not_of("0123456789") != std::string::npos) continue;
    std::ifstream file(entry.path() / "environ", std::ios::binary);
    const std::string variables((std::istreambuf_iterator<char>(file)), {});
    if (variables.find("SLURMD_NODENAME=" + node + std::string(1, '\0')) == std::string::npos) {
      continue;
    }
    jobs.push_back(std::stoi(pid));
    pid_t parent = 0;
    std::ifstream status(entry.path() / "status");
    for (std::string word; status >> word;) {
      if (word == "PPid:") status >> parent;
    }
    std::string name;
    std::getline(std::ifstream(absl::StrCat("/proc/", parent, "/comm")) >> std::ws, name);
    if (name.starts_with("slurmstepd")) daemons.push_back(parent);
  }
  for (const pid_t pid : daemons) kill(pid, SIGKILL);
  for (const pid_t pid : jobs) kill(pid, SIGKILL);
}

}  // namespace pepeseg::testing
