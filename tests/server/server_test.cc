#include "server/server.h"

#include <gmock/gmock.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <spawn.h>
#include <sys/wait.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include "absl/time/clock.h"
#include "server/access/api_key.h"
#include "server/listen_rules.h"
#include "server/store/layout.h"
#include "server/store/store.h"
#include "tests/server/health_check.h"
#include "tests/server/shelf_model.h"

namespace pepeseg {
namespace {

TEST(IsLoopback, AcceptsOnlyAddressesOfThisMachine) {
  for (const char* near : {"127.0.0.1:0", "127.1.2.3:50051", "localhost:1", "[::1]:1", "unix:/x"}) {
    EXPECT_TRUE(IsLoopback(near)) << near;
  }
  for (const char* far : {"0.0.0.0:1", "[::]:1", "10.0.0.1:1", "127.example.com:1", "host:1", ":1",
                          "", "127.0.0.1"}) {
    EXPECT_FALSE(IsLoopback(far)) << far;
  }
}

grpc::Status CreateScene(const std::shared_ptr<grpc::Channel>& channel, const std::string& id) {
  v1::CreateSceneRequest request;
  request.set_scene_id(id);
  return CallOver(channel, &SceneStub::CreateScene, request);
}

TEST(ServerShutdown, EndsStreamsAndRequeuesJobs) {
  RunningServer running(PEPESEG_FAKE_WORKER);
  running.CreateScene("shelf");
  const v1::Job job = running.Train("shelf", "hang");
  const v1::Upload upload = running.CreateUpload("shelf", {{"images/1.jpg", "one"}});

  grpc::ClientContext watch_context;
  const auto watcher = running.jobs->WatchJob(&watch_context, Named{job.name()});
  v1::JobEvent event;
  ASSERT_TRUE(watcher->Read(&event));
  grpc::ClientContext write_context;
  v1::WriteFilesResponse response;
  const auto writer = running.datasets->WriteFiles(&write_context, &response);
  ASSERT_TRUE(writer->Write(HeaderPart(upload.name(), "images/1.jpg")));

  std::thread shutdown([&] { running.server->Shutdown(absl::Now() + absl::Seconds(20)); });
  while (watcher->Read(&event)) {
  }
  EXPECT_ERROR(watcher->Finish(), grpc::UNAVAILABLE, {.reason = "DRAINING"});
  EXPECT_ERROR(writer->Finish(), grpc::UNAVAILABLE);
  shutdown.join();
  running.server.reset();

  ASSERT_OK_AND_ASSIGN(auto again, Server::Start(running.options));
  ASSERT_OK_AND_ASSIGN(const v1::Job resumed,
                       CallOver(again->InProcessChannel(), &JobStub::GetJob, Named{job.name()}));
  EXPECT_TRUE(resumed.state() == v1::JOB_STATE_QUEUED || resumed.state() == v1::JOB_STATE_RUNNING)
      << resumed.DebugString();
}

// Runs the program, and waits for its port file.
struct Program {
  explicit Program(const testing::TempFolder& folder,
                   const std::string& worker = PEPESEG_FAKE_WORKER,
                   const std::vector<std::string>& more = {}) {
    const std::string port_file = (folder / "port").string();
    std::vector<std::string> words = {PEPESEG_SERVER, "--data=" + (folder / "data").string(),
                                      "--port-file=" + port_file, "--worker=" + worker,
                                      "--listen=127.0.0.1:0"};
    words.insert(words.end(), more.begin(), more.end());
    std::vector<char*> arguments;
    arguments.reserve(words.size() + 1);
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    EXPECT_EQ(posix_spawn(&pid, PEPESEG_SERVER, nullptr, nullptr, arguments.data(), environ), 0);
    EXPECT_TRUE(testing::Eventually([&] { return !!(std::ifstream(port_file) >> port); },
                                    absl::Seconds(30)));
  }
  ~Program() {
    if (!ended) kill(pid, SIGKILL);
    if (!ended) waitpid(pid, nullptr, 0);
  }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;
  int Await() {
    int state = -1;
    waitpid(pid, &state, 0);
    ended = true;
    return state;
  }
  pid_t pid = -1;
  int port = 0;
  bool ended = false;
};

TEST(ServerProgram, ServesAndExitsCleanlyOnSigterm) {
  const testing::TempFolder folder;
  Program program(folder);
  ASSERT_GT(program.port, 0);
  ASSERT_OK(CreateScene(ConnectTo(program.port), "shelf"));
  kill(program.pid, SIGTERM);
  const int state = program.Await();
  EXPECT_TRUE(WIFEXITED(state));
  EXPECT_EQ(WEXITSTATUS(state), 0);
}

struct ReflectionAnswer {
  grpc::Status status;
  std::string bytes;  // of the response
};

// Asks reflection for the list of services.
ReflectionAnswer AskReflection(const std::shared_ptr<grpc::Channel>& channel,
                               const std::string& authorization = "") {
  constexpr char kListServices[] = "\x3a\x01*";  // field 7 of ServerReflectionRequest
  grpc::GenericStub stub(channel);
  grpc::CompletionQueue queue;
  grpc::ClientContext context;
  if (!authorization.empty()) context.AddMetadata("authorization", authorization);
  const grpc::Slice request(kListServices);
  const auto call = stub.PrepareCall(
      &context, "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", &queue);
  const auto await = [&queue] {
    void* tag = nullptr;
    bool ok = false;
    return queue.Next(&tag, &ok) && ok;
  };
  call->StartCall(&queue);
  if (await()) {
    call->Write(grpc::ByteBuffer(&request, 1), &queue);
    await();
    call->WritesDone(&queue);
    await();
  }
  ReflectionAnswer answer;
  grpc::ByteBuffer response;
  do {
    std::vector<grpc::Slice> slices;
    if (response.Dump(&slices).ok()) {
      for (const grpc::Slice& slice : slices) {
        answer.bytes.append(reinterpret_cast<const char*>(slice.begin()), slice.size());
      }
    }
    call->Read(&response, &queue);
  } while (await());
  call->Finish(&answer.status, &queue);
  await();
  return answer;
}

TEST(ServerProgram, ServesReflectionOnlyIfAskedTo) {
  const testing::TempFolder without, with;
  const Program silent(without);
  ASSERT_GT(silent.port, 0);
  EXPECT_ERROR(AskReflection(ConnectTo(silent.port)).status, grpc::UNIMPLEMENTED);
  const Program open(with, PEPESEG_FAKE_WORKER, {"--reflection"});
  ASSERT_GT(open.port, 0);
  const ReflectionAnswer answer = AskReflection(ConnectTo(open.port));
  EXPECT_OK(answer.status);
  EXPECT_THAT(answer.bytes, ::testing::HasSubstr("pepeseg.v1.SceneService"));
}

TEST(ServerProgram, ServesReflectionWithAKeyOnly) {
  const testing::TempFolder folder;
  std::string secret;
  {
    ASSERT_OK_AND_ASSIGN(NewKey key, MakeKey());
    key.record.project = "lab";
    key.record.scopes = ScopeBit(v1::SCOPE_READ);
    std::filesystem::create_directories(folder / "data");
    ASSERT_OK_AND_ASSIGN(const auto store,
                         Store::Open("sqlite:" + DatabasePath(folder / "data").string()));
    ASSERT_OK(store->keys().CreateKey(key.record));
    secret = key.secret;
  }
  const Program program(folder, PEPESEG_FAKE_WORKER, {"--reflection", "--require-keys"});
  ASSERT_GT(program.port, 0);
  const auto channel = ConnectTo(program.port);
  const ReflectionAnswer answer = AskReflection(channel, "Bearer " + secret);
  EXPECT_OK(answer.status);
  EXPECT_THAT(answer.bytes, ::testing::HasSubstr("pepeseg.v1.SceneService"));
  for (const std::string& wrong : {std::string(), "Bearer " + MakeKey()->secret}) {
    const ReflectionAnswer refused = AskReflection(channel, wrong);
    EXPECT_ERROR(refused.status, grpc::UNAUTHENTICATED,
                 {.reason = wrong.empty() ? "NO_KEY" : "BAD_KEY"});
    EXPECT_THAT(refused.bytes, ::testing::Not(::testing::HasSubstr("pepeseg")));
  }
  std::ifstream file(RefusalPath(folder / "data"));
  const std::string refusals{std::istreambuf_iterator<char>(file), {}};
  EXPECT_THAT(refusals, ::testing::HasSubstr("grpc.reflection"));
}

v1::Job TrainOn(const std::shared_ptr<grpc::Channel>& channel, const std::string& scene,
                const std::string& file) {
  EXPECT_OK(CreateScene(channel, scene));
  v1::CreateUploadRequest create = Under{"scenes/" + scene};
  const TestFile bytes = {file, "bytes"};
  *create.add_files() = Declare(bytes);
  const v1::Upload upload = *CallOver(channel, &DatasetStub::CreateUpload, create);
  grpc::ClientContext writing;
  v1::WriteFilesResponse written;
  const auto stream = DatasetStub(channel).WriteFiles(&writing, &written);
  for (const v1::WriteFilesRequest& part : FileParts(upload.name(), bytes)) stream->Write(part);
  stream->WritesDone();
  EXPECT_OK(stream->Finish());
  v1::TrainSceneRequest request;
  request.set_scene("scenes/" + scene);
  request.set_dataset(CallOver(channel, &DatasetStub::SealUpload, Named{upload.name()})->name());
  return *CallOver(channel, &JobStub::TrainScene, request);
}

// The order: NOT_SERVING, a time in which calls are still answered, the end of streams, answers to
// the calls in progress, exit.
TEST(ServerProgram, StopsInOrderOnSigterm) {
  const testing::TempFolder folder;
  Program program(folder, PEPESEG_MODEL_WORKER, {"--drain-seconds=2", "--grace=20"});
  ASSERT_GT(program.port, 0);
  const auto channel = ConnectTo(program.port);
  const auto jobs = v1::JobService::NewStub(channel);
  const v1::Job made = TrainOn(channel, "shelf", "file");
  v1::JobEvent event;
  {
    grpc::ClientContext context;
    const auto until_made = jobs->WatchJob(&context, Named{made.name()});
    while (until_made->Read(&event)) {
    }
    EXPECT_OK(until_made->Finish());
  }
  const v1::Job hanging = TrainOn(channel, "idle", "hang");
  grpc::ClientContext watch_context;
  const auto watcher = jobs->WatchJob(&watch_context, Named{hanging.name()});
  ASSERT_TRUE(watcher->Read(&event));

  kill(program.pid, SIGTERM);
  ASSERT_TRUE(testing::Eventually([&] { return CheckHealth(channel, "") != kServing; }));
  // The first query loads the model, so it is still in progress when the streams end.
  const auto query = Click<v1::ProposeScalesRequest>(30);
  int num_answered = 0;
  grpc::Status last;
  do {
    last = CallOver(channel, &SegmentationStub::ProposeScales, query);
    num_answered += last.ok() ? 1 : 0;
  } while (last.ok());
  EXPECT_GT(num_answered, 0);
  // No call is cut off in the middle: it is refused, or the connection is closed.
  EXPECT_ERROR(last, grpc::UNAVAILABLE);
  while (watcher->Read(&event)) {
  }
  EXPECT_ERROR(watcher->Finish(), grpc::UNAVAILABLE, {.reason = "DRAINING"});
  const int state = program.Await();
  EXPECT_TRUE(WIFEXITED(state));
  EXPECT_EQ(WEXITSTATUS(state), 0);
}

struct Output {
  int exit_code = -1;
  std::string text;  // standard output and error
};

// Runs a command in the shell.
Output RunShell(const std::string& line) {
  Output output;
  FILE* pipe = popen((line + " 2>&1").c_str(), "r");
  char buffer[4096];
  while (std::fgets(buffer, sizeof(buffer), pipe) != nullptr) output.text += buffer;
  output.exit_code = WEXITSTATUS(pclose(pipe));
  return output;
}

TEST(ServerProgram, ReportsAPortInUseInOneLine) {
  const testing::TempFolder folder;
  const Program first(folder);
  ASSERT_GT(first.port, 0);
  const std::string address = "127.0.0.1:" + std::to_string(first.port);
  const Output second =
      RunShell(PEPESEG_SERVER " --listen " + address + " --data " + (folder / "other").string());
  EXPECT_EQ(second.exit_code, 1);
  EXPECT_EQ(std::count(second.text.begin(), second.text.end(), '\n'), 1) << second.text;
  for (const std::string& part : {address, std::string("in use"), std::string("another port")}) {
    EXPECT_NE(second.text.find(part), std::string::npos) << second.text;
  }
}

// If another server on this machine has the default port, the program must report that.
TEST(ServerProgram, ServesWithoutArguments) {
  const testing::TempFolder folder;
  const Output output = RunShell("XDG_DATA_HOME=" + folder.path().string() +
                                 " timeout --signal=TERM 3 " PEPESEG_SERVER);
  if (output.text.find("in use") != std::string::npos) {
    EXPECT_NE(output.text.find("127.0.0.1:50051"), std::string::npos) << output.text;
    return;
  }
  EXPECT_EQ(output.exit_code, 124) << output.text;
  EXPECT_NE(output.text.find("serving on 127.0.0.1:50051"), std::string::npos) << output.text;
  EXPECT_TRUE(std::filesystem::exists(folder / "pepeseg" / "pepeseg.db"));
  EXPECT_EQ(std::filesystem::status(folder / "pepeseg").permissions(),
            std::filesystem::perms::owner_all);
}

TEST(ServerProgram, StoresDataInHomeWithoutXdgDataHome) {
  const Output help = RunShell("XDG_DATA_HOME=relative HOME=/home/anna " PEPESEG_SERVER " --help");
  EXPECT_NE(help.text.find("/home/anna/.local/share/pepeseg"), std::string::npos) << help.text;
  const Output homeless = RunShell("env -u XDG_DATA_HOME -u HOME " PEPESEG_SERVER);
  EXPECT_NE(homeless.exit_code, 0);
  EXPECT_NE(homeless.text.find("--data"), std::string::npos) << homeless.text;
}

TEST(ServerProgram, LosesNothingWhenKilled) {
  const testing::TempFolder folder;
  {
    Program program(folder);
    ASSERT_GT(program.port, 0);
    ASSERT_OK(CreateScene(ConnectTo(program.port), "shelf"));
    kill(program.pid, SIGKILL);
    program.Await();
  }
  std::filesystem::remove(folder / "port");
  Program program(folder);
  EXPECT_OK(CallOver(ConnectTo(program.port), &SceneStub::GetScene, Named{"scenes/shelf"}));
}

}  // namespace
}  // namespace pepeseg
