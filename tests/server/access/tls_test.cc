// Encryption over real sockets.
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "server/listen_rules.h"
#include "server/rpc/listener_probe.h"
#include "server/rpc/listening_sockets.h"
#include "tests/server/access/test_certificates.h"
#include "tests/server/running_server.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using testing::IssuedCertificate;
using testing::TestAuthority;

struct Tls : ::testing::Test {
  Tls() {
    options.admin = "127.0.0.1:0";
    options.access.tls_certificate = folder / "chain.pem";
    options.access.tls_key = folder / "key.pem";
    WriteChain(issued);
    WriteKey(issued);
  }
  void Start() { running = std::make_unique<RunningServer>(PEPESEG_FAKE_WORKER, options); }
  void DemandClientCertificates() {
    options.access.tls_client_ca = folder / "clients.pem";
    std::ofstream(options.access.tls_client_ca) << clients.certificate();
  }
  void WriteChain(const IssuedCertificate& pair) const {
    std::ofstream(folder / "chain.pem", std::ios::trunc) << pair.certificate;
  }
  void WriteKey(const IssuedCertificate& pair) const {
    std::ofstream(folder / "key.pem", std::ios::trunc) << pair.key;
  }
  static std::shared_ptr<grpc::ChannelCredentials> Trusting(const TestAuthority& authority,
                                                            const IssuedCertificate& own = {}) {
    return grpc::SslCredentials({authority.certificate(), own.key, own.certificate});
  }
  // Opens a connection of its own: channels to one address would share one.
  static std::shared_ptr<grpc::Channel> Connect(
      int port, const std::shared_ptr<grpc::ChannelCredentials>& credentials) {
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    return grpc::CreateCustomChannel(absl::StrCat("127.0.0.1:", port), credentials, arguments);
  }
  grpc::StatusCode List(const std::shared_ptr<grpc::ChannelCredentials>& credentials) const {
    return ListOver(Connect(running->server->port(), credentials));
  }
  static grpc::StatusCode ListOver(const std::shared_ptr<grpc::Channel>& channel) {
    return CallOver(channel, &SceneStub::ListScenes, {}).status().error_code();
  }
  // Returns the seconds until a new connection that trusts only `authority` is served, at most 30.
  double AwaitServedTo(const TestAuthority& authority) const {
    const absl::Time start = absl::Now();
    EXPECT_TRUE(testing::Eventually([&] { return List(Trusting(authority)) == grpc::OK; },
                                    absl::Seconds(30)));
    return absl::ToDoubleSeconds(absl::Now() - start);
  }

  testing::TempFolder folder;
  TestAuthority authority{"authority"}, other{"other authority"}, clients{"of clients"};
  IssuedCertificate issued = authority.Issue("server");
  ServerOptions options;
  std::unique_ptr<RunningServer> running;
};

TEST_F(Tls, ServesClientsThatTrustItsChain) {
  Start();
  EXPECT_EQ(List(Trusting(authority)), grpc::OK);
  EXPECT_EQ(List(Trusting(other)), grpc::UNAVAILABLE);
  EXPECT_EQ(List(grpc::InsecureChannelCredentials()), grpc::UNAVAILABLE);
  const auto ask_admin = [&](const std::shared_ptr<grpc::ChannelCredentials>& credentials) {
    const auto channel = Connect(running->server->admin_port(), credentials);
    return CallOver(channel, &AdminStub::ListResidentModels, {}).status().error_code();
  };
  EXPECT_EQ(ask_admin(Trusting(authority)), grpc::OK);
  EXPECT_EQ(ask_admin(Trusting(other)), grpc::UNAVAILABLE);
  EXPECT_EQ(ask_admin(grpc::InsecureChannelCredentials()), grpc::UNAVAILABLE);
}

TEST_F(Tls, RequiresClientCertificatesWithAClientCa) {
  DemandClientCertificates();
  Start();
  EXPECT_EQ(List(Trusting(authority, clients.Issue("client"))), grpc::OK);
  EXPECT_EQ(List(Trusting(authority)), grpc::UNAVAILABLE);
  EXPECT_EQ(List(Trusting(authority, other.Issue("client"))), grpc::UNAVAILABLE);
  EXPECT_EQ(List(Trusting(authority, issued)), grpc::UNAVAILABLE);
}

// Runs a server that probes itself every 50 ms, and expects that all probes reach it.
void ExpectReachable(ServerOptions options) {
  options.self_probe = absl::Milliseconds(50);
  std::atomic<bool> unreachable = false;
  options.on_unreachable = [&] { unreachable = true; };
  const RunningServer running(PEPESEG_FAKE_WORKER, options);
  absl::SleepFor(absl::Seconds(2));
  EXPECT_FALSE(unreachable);
}

TEST_F(Tls, SelfProbeReachesTheListener) {
  ServerOptions local;
  local.listen = "unix:" + (folder / "socket").string();
  ExpectReachable(local);
  options.listen = "0.0.0.0:0";
  options.access.require_keys = true;
  ExpectReachable(options);
}

TEST_F(Tls, SelfProbeReachesAListenerThatRequiresCertificates) {
  DemandClientCertificates();
  ExpectReachable(options);
}

TEST_F(Tls, ProbeFailsIfNothingAnswers) {
  ASSERT_OK_AND_ASSIGN(auto mute, ListeningSockets::Open("127.0.0.1:0"));
  ListenerProbeOptions probe;
  probe.listening = mute.descriptors().front();
  probe.timeout = absl::Milliseconds(200);
  std::vector<std::string> addresses;
  probe.on_address = [&](const std::string& address) { addresses.push_back(address); };
  EXPECT_EQ(ProbeListener(probe).message(), "health: no answer");
  ASSERT_EQ(addresses.size(), 2u);
  EXPECT_FALSE(addresses[0].empty());
  EXPECT_TRUE(addresses[1].empty());
  mute.Close();
  EXPECT_FALSE(ProbeListener(probe).ok());
}

// TLS is left out for the probe's own socket alone.
TEST_F(Tls, RefusesConnectionsWithoutTlsWhileTheProbeRuns) {
  options.self_probe = absl::Milliseconds(1);
  Start();
  for (int i = 0; i < 50; ++i) {
    EXPECT_EQ(List(grpc::InsecureChannelCredentials()), grpc::UNAVAILABLE);
  }
  EXPECT_EQ(List(Trusting(authority)), grpc::OK);
}

TEST_F(Tls, AcceptsIdentitiesFromTheGatewaysCertificateOnly) {
  DemandClientCertificates();
  options.access.require_keys = true;
  options.access.trusted_gateway = "gateway";
  Start();
  const auto create = [&](const IssuedCertificate& own, const std::string& id,
                          const std::string& scopes) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(20));
    context.AddMetadata("x-pepeseg-project", "lab");
    context.AddMetadata("x-pepeseg-scopes", scopes);
    context.AddMetadata("x-pepeseg-subject", "ann");
    v1::CreateSceneRequest request;
    request.set_scene_id(id);
    const auto channel = Connect(running->server->port(), Trusting(authority, own));
    return CallWith(context, channel, &SceneStub::CreateScene, request);
  };
  EXPECT_OK(create(clients.Issue("gateway"), "a", "read,write"));
  EXPECT_ERROR(create(clients.Issue("gateway"), "b", "read"), grpc::PERMISSION_DENIED);
  EXPECT_ERROR(create(clients.Issue("gateway"), "b", "operate"), grpc::UNAUTHENTICATED);
  for (const char* name : {"client", "gateway.example.org", "xgateway"}) {
    EXPECT_ERROR(create(clients.Issue(name), "b", "read,write"), grpc::UNAUTHENTICATED,
                 {.reason = "NOT_A_GATEWAY"})
        << name;
  }
  // The gateway's certificate alone is not enough.
  EXPECT_EQ(List(Trusting(authority, clients.Issue("gateway"))), grpc::UNAUTHENTICATED);
  EXPECT_ERROR(create(other.Issue("gateway"), "b", "read,write"), grpc::UNAVAILABLE);
}

TEST_F(Tls, LoadsAReplacedCertificateWhileItServes) {
  Start();
  const auto old_channel = Connect(running->server->port(), Trusting(authority));
  ASSERT_EQ(ListOver(old_channel), grpc::OK);
  // A call that continues while the certificate changes.
  running->CreateScene("a");
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
  v1::WriteFilesResponse written;
  const auto old_call = v1::DatasetService::NewStub(old_channel)->WriteFiles(&context, &written);
  const TestFile file = {"a.jpg", "bytes"};
  const std::vector<v1::WriteFilesRequest> parts =
      FileParts(running->CreateUpload("a", {file}).name(), file);
  ASSERT_TRUE(old_call->Write(parts[0]));

  const IssuedCertificate renewed = other.Issue("server");
  WriteKey(renewed);  // does not belong to the old certificate, so nothing may change
  absl::SleepFor(absl::Seconds(3));
  EXPECT_EQ(List(Trusting(authority)), grpc::OK);
  EXPECT_EQ(List(Trusting(other)), grpc::UNAVAILABLE);
  WriteChain(renewed);
  EXPECT_LT(AwaitServedTo(other), 5);
  EXPECT_EQ(List(Trusting(authority)), grpc::UNAVAILABLE);

  EXPECT_EQ(ListOver(old_channel), grpc::OK);
  for (size_t i = 1; i < parts.size(); ++i) EXPECT_TRUE(old_call->Write(parts[i]));
  old_call->WritesDone();
  EXPECT_OK(old_call->Finish());
  EXPECT_EQ(written.num_files(), 1);
}

TEST_F(Tls, SurvivesManyReplacementsUnderLoad) {
  Start();
  for (int round = 0; round < 5; ++round) {
    TestAuthority& next = round % 2 == 0 ? other : authority;
    const IssuedCertificate renewed = next.Issue("server");
    // Garbage, an empty file and no file, as a careless writer leaves them for a moment.
    std::ofstream(folder / "key.pem", std::ios::trunc) << renewed.key.substr(0, 40);
    std::ofstream(folder / "chain.pem", std::ios::trunc);
    for (int i = 0; i < 20; ++i) List(Trusting(authority));
    std::filesystem::remove(folder / "chain.pem");
    absl::SleepFor(absl::Milliseconds(1200));
    WriteChain(renewed);
    WriteKey(renewed);
    EXPECT_LT(AwaitServedTo(next), 5);
  }
}

TEST_F(Tls, RefusesToStartWithFilesThatDoNotBelongTogether) {
  WriteKey(authority.Issue("another"));
  options.data = folder / "data";
  options.worker = PEPESEG_FAKE_WORKER;
  options.devices = "cpu";
  EXPECT_STATUS(Server::Start(options), absl::StatusCode::kFailedPrecondition, "key.pem");
}

TEST(ListenRules, RefuseUnprotectedListeners) {
  const auto is_ok = [](const std::string& listen, bool tls, bool keys, bool insecure) {
    for (const bool is_admin : {false, true}) {
      ServerOptions options;
      (is_admin ? options.admin : options.listen) = listen;
      options.insecure = insecure;
      options.access.require_keys = keys;
      if (tls) options.access.tls_certificate = options.access.tls_key = "file.pem";
      const absl::Status status = CheckListeners(options);
      EXPECT_TRUE(status.ok() || absl::IsFailedPrecondition(status)) << status;
      if (!status.ok()) return false;
    }
    return true;
  };
  for (const char* here : {"127.0.0.1:0", "127.3.2.1:5", "[::1]:0", "localhost:1", "unix:/x"}) {
    EXPECT_TRUE(is_ok(here, false, false, false)) << here;
  }
  for (const char* beyond : {"0.0.0.0:0", "[::]:0", "10.0.0.1:1", "example.org:1", "*:1",
                             "127.0.0.1.example.org:1", "50051"}) {
    EXPECT_FALSE(is_ok(beyond, false, false, false)) << beyond;
    EXPECT_FALSE(is_ok(beyond, true, false, false)) << beyond;
    EXPECT_FALSE(is_ok(beyond, false, true, false)) << beyond;
    EXPECT_TRUE(is_ok(beyond, true, true, false)) << beyond;
    EXPECT_TRUE(is_ok(beyond, false, false, true)) << beyond;
    EXPECT_TRUE(is_ok(beyond, true, false, true)) << beyond;
  }
}

}  // namespace
}  // namespace pepeseg
