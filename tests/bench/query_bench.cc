// Measures the latency of requests to a running server from a client on the same host, and the
// processor time that an answer takes client and server. Usage:
//   pepeseg_query_bench --server 127.0.0.1:PORT SCENE [--pixels 1000000] [--clients 64]
//       [--server-process ID]
#include <grpcpp/grpcpp.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <optional>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "pepeseg/v1/scene_service.grpc.pb.h"
#include "pepeseg/v1/segmentation_service.grpc.pb.h"
#include "tests/bench/bench_clock.h"

namespace pepeseg {
namespace {

struct BenchOptions {
  std::string server = "127.0.0.1:7300";
  std::string scene;
  double num_pixels = 1e6;
  int repeats = 50;
  int num_clients = 64;
  double seconds = 5;
  int server_process = 0;  // 0: unknown
  std::string only;        // the name of a row; empty: all rows
};

double MsOf(const google::protobuf::Duration& duration) {
  return static_cast<double>(duration.seconds()) * 1e3 +
         static_cast<double>(duration.nanos()) * 1e-6;
}

// Returns the processor time of a process so far, ms; 0: it is unknown.
double CoreMsOf(int process) {
  std::ifstream file("/proc/" + std::to_string(process) + "/stat");
  const std::string text(std::istreambuf_iterator<char>(file), {});
  // The name, in parentheses, may have spaces; user and system time are the 12th and 13th after it.
  std::istringstream fields(text.substr(std::min(text.size(), text.rfind(')') + 1)));
  std::string skipped;
  for (int i = 0; i < 11; ++i) fields >> skipped;
  double user = 0, system = 0;
  fields >> user >> system;
  return 1e3 * (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

// The answers to one kind of request.
struct Answers {
  explicit Answers(int server_process) : server_process_(server_process) {}

  void Add(double latency_ms, const v1::QueryTiming& timing) {
    ms.push_back(latency_ms);
    queue += MsOf(timing.queue()), load += MsOf(timing.load());
    compute += MsOf(timing.compute()), encode += MsOf(timing.encode());
  }
  void Add(const Answers& other) {
    ms.insert(ms.end(), other.ms.begin(), other.ms.end());
    queue += other.queue, load += other.load;
    compute += other.compute, encode += other.encode;
  }
  void Print(const char* name) {
    if (ms.empty()) return;
    const double client = 1e3 * (CoreNow() - client_start_);
    const double server = CoreMsOf(server_process_) - server_start_;
    std::sort(ms.begin(), ms.end());
    const auto count = static_cast<double>(ms.size());
    const auto at = [&](double share) { return ms[static_cast<size_t>(share * (count - 1))]; };
    std::printf("| %s | %zu | %.2f | %.2f | %.2f | %.2f | %.2f | %.2f | %.2f | %.2f | %.2f |\n",
                name, ms.size(), at(0.5), at(0.9), at(0.99), queue / count, load / count,
                compute / count, encode / count, client / count, server / count);
  }

  std::vector<double> ms;                               // as the client sees them
  double queue = 0, load = 0, compute = 0, encode = 0;  // ms of all, as the server says

 private:
  int server_process_;
  double client_start_ = CoreNow(), server_start_ = CoreMsOf(server_process_);
};

class Bench {
 public:
  explicit Bench(const BenchOptions& options)
      : options_(options),
        channel_(grpc::CreateChannel(options.server, grpc::InsecureChannelCredentials())),
        scenes_(v1::SceneService::NewStub(channel_)),
        segmentation_(v1::SegmentationService::NewStub(channel_)) {}

  // The first view, at the wanted number of pixels, and a click on something in it.
  bool Prepare() {
    grpc::ClientContext context;
    v1::ListViewsRequest list;
    list.set_parent(model());
    v1::ListViewsResponse views;
    const grpc::Status status = scenes_->ListViews(&context, list, &views);
    if (!status.ok() || views.views().empty()) {
      std::fprintf(stderr, "no views: %s\n", status.error_message().c_str());
      return false;
    }
    view_ = views.views(0);
    v1::PinholeCamera& camera = *view_.mutable_camera();
    const double factor =
        std::sqrt(options_.num_pixels / (static_cast<double>(camera.width()) * camera.height()));
    camera.set_width(static_cast<int>(std::lround(factor * camera.width())));
    camera.set_height(static_cast<int>(std::lround(factor * camera.height())));
    camera.set_fx(factor * camera.fx()), camera.set_fy(factor * camera.fy());
    camera.set_cx(factor * camera.cx()), camera.set_cy(factor * camera.cy());
    for (const double y : {0.5, 0.6, 0.4, 0.7, 0.3}) {
      for (const double x : {0.5, 0.4, 0.6, 0.3, 0.7}) {
        click_x_ = x * camera.width(), click_y_ = y * camera.height();
        if (Ask(Click(0.3, 0.75, 0))) return true;
      }
    }
    std::fprintf(stderr, "no click on anything\n");
    return false;
  }

  void Run() {
    std::printf("%d x %d pixels\n\n", view_.camera().width(), view_.camera().height());
    std::printf(
        "| request | answers | p50 ms | p90 ms | p99 ms | mean queue ms | load ms | compute "
        "ms | encode ms | client's core ms | server's core ms |\n");
    std::printf("|---|---|---|---|---|---|---|---|---|---|---|\n");
    Repeat("cached view, the same", [&](int) { return Click(0.3, 0.75, 0); });
    Repeat("cached view, another scale", [&](int i) { return Click(0.01 + 0.01 * i, 0.75, 0); });
    Repeat("cached view, another threshold", [&](int i) { return Click(0.3, 0.5 + 0.005 * i, 0); });
    Repeat("cached view, five points", [&](int i) {
      v1::SegmentViewsRequest request = Click(0.3, 0.5 + 0.005 * i, 0);
      for (int k = 1; k < 5; ++k) {
        auto* point = request.mutable_prompt()->mutable_points()->add_points();
        *point = request.prompt().points().points(0);
        point->set_x(point->x() + k);
        point->set_negative(k > 2);
      }
      return request;
    });
    Repeat("a new view each", [&](int i) { return Click(0.3, 0.75, 1 + i); });
    Repeat("cached view, scale and threshold chosen", [&](int) {
      v1::SegmentViewsRequest request = Click(0.3, 0.75, 0);
      request.clear_granularity();
      return request;
    });
    Drag();
    AskTogether();
  }

 private:
  std::string model() const { return "scenes/" + options_.scene + "/models/live"; }

  bool IsWanted(const char* name) const { return options_.only.empty() || options_.only == name; }

  // moved: displacement of the camera, which gives a view that the server has not rendered yet.
  v1::SegmentViewsRequest Click(double scale, double threshold, int moved) const {
    v1::SegmentViewsRequest request;
    request.set_model(model());
    v1::Viewpoint::FreeCamera& free = *request.mutable_prompt()->mutable_view()->mutable_free();
    *free.mutable_camera() = view_.camera();
    *free.mutable_cam_from_world() = view_.cam_from_world();
    v1::Vector3& translation = *free.mutable_cam_from_world()->mutable_translation();
    translation.set_x(translation.x() + 1e-4 * moved);
    auto* point = request.mutable_prompt()->mutable_points()->add_points();
    point->set_x(click_x_);
    point->set_y(click_y_);
    request.mutable_granularity()->set_scale_quantile(scale);
    request.mutable_granularity()->set_threshold(threshold);
    return request;
  }

  std::optional<v1::SegmentViewsResponse> Ask(const v1::SegmentViewsRequest& request) {
    grpc::ClientContext context;
    v1::SegmentViewsResponse response;
    if (!segmentation_->SegmentViews(&context, request, &response).ok()) return std::nullopt;
    return response;
  }

  template <typename MakeRequest>
  void Repeat(const char* name, const MakeRequest& make) {
    if (!IsWanted(name)) return;
    Answers answers(options_.server_process);
    for (int i = 0; i < options_.repeats; ++i) {
      const v1::SegmentViewsRequest request = make(i);
      const double start = NowMs();
      const auto answer = Ask(request);
      if (answer) answers.Add(NowMs() - start, answer->timing());
    }
    answers.Print(name);
  }

  void Drag() {
    const char* const name = "cached view, by StreamSegments";
    if (!IsWanted(name)) return;
    grpc::ClientContext context;
    const auto stream = segmentation_->StreamSegments(&context);
    Answers answers(options_.server_process);
    v1::StreamSegmentsResponse answer;
    for (int i = 0; i < options_.repeats; ++i) {
      v1::StreamSegmentsRequest request;
      request.set_sequence(i + 1);
      *request.mutable_segment() = Click(0.3, 0.75, 0);
      const double start = NowMs();
      if (!stream->Write(request) || !stream->Read(&answer) || !answer.has_segment()) break;
      answers.Add(NowMs() - start, answer.segment().timing());
    }
    stream->WritesDone();
    stream->Finish();
    answers.Print(name);
  }

  // Every client sends requests continuously on a connection of its own.
  void AskTogether() {
    const char* const name = "cached view, all clients at once";
    if (!IsWanted(name)) return;
    Answers all(options_.server_process);
    std::vector<Answers> of_client(options_.num_clients, Answers(0));
    std::atomic<int> num_failed = 0;
    std::vector<std::thread> clients;
    clients.reserve(of_client.size());
    const double start = NowMs(), end = start + 1000 * options_.seconds;
    for (int c = 0; c < options_.num_clients; ++c) {
      clients.emplace_back([&, c] {
        grpc::ChannelArguments own;
        own.SetInt("pepeseg.client", c);
        const auto stub = v1::SegmentationService::NewStub(
            grpc::CreateCustomChannel(options_.server, grpc::InsecureChannelCredentials(), own));
        for (int i = 0; NowMs() < end; ++i) {
          const v1::SegmentViewsRequest request = Click(0.01 * (i % 100), 0.75, 0);
          grpc::ClientContext context;
          context.set_wait_for_ready(true);  // 64 connections at once take a while
          v1::SegmentViewsResponse response;
          const double asked = NowMs();
          const grpc::Status status = stub->SegmentViews(&context, request, &response);
          if (status.ok()) {
            of_client[c].Add(NowMs() - asked, response.timing());
          } else if (num_failed++ == 0) {
            std::printf("refused: %s\n", status.error_message().c_str());
          }
        }
      });
    }
    for (std::thread& client : clients) client.join();
    const double seconds = (NowMs() - start) / 1000;
    for (const Answers& one : of_client) all.Add(one);
    const auto count = static_cast<double>(all.ms.size());
    all.Print(name);
    std::printf("\n%d clients: %.0f answers a second, %d refused\n", options_.num_clients,
                count / seconds, num_failed.load());
  }

  const BenchOptions options_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::SceneService::Stub> scenes_;
  std::unique_ptr<v1::SegmentationService::Stub> segmentation_;
  v1::View view_;
  double click_x_ = 0, click_y_ = 0;
};

}  // namespace
}  // namespace pepeseg

// NOLINTNEXTLINE(bugprone-exception-escape): CLI11 throws only what CLI11_PARSE catches.
int main(int argc, char** argv) {
  pepeseg::BenchOptions options;
  CLI::App app("Latency of requests to a running server");
  app.add_option("scene", options.scene, "Id of the scene")->required();
  app.add_option("--server", options.server);
  app.add_option("--pixels", options.num_pixels, "size of the requested view, pixels");
  app.add_option("--repeats", options.repeats);
  app.add_option("--clients", options.num_clients);
  app.add_option("--seconds", options.seconds, "duration of the test with all clients, seconds");
  app.add_option("--server-process", options.server_process, "id of the server's process");
  app.add_option("--only", options.only, "measure only the request of this name");
  CLI11_PARSE(app, argc, argv);
  pepeseg::Bench bench(options);
  if (!bench.Prepare()) return EXIT_FAILURE;
  bench.Run();
  return EXIT_SUCCESS;
}
