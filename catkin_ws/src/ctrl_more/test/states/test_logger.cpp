#include <cstdio>
#include <fstream>
#include <sstream>
#include <thread>

#include "test_support.hpp"

namespace ctrl_more {
namespace {

TEST(LoggerTest, RecordsCarrySourcePlaceCycleAndNumbers) {
  Logger logger;
  auto sink = std::make_shared<ListSink>();
  logger.addSink(sink);
  std::atomic<std::uint64_t> cycle{17};
  const LogSource source(&logger, "attitude", &cycle);
  CTRL_MORE_LOG(source, Warning, "force {} N above {} N", 12.5, 10);
  EXPECT_TRUE(sink->lines.empty()) << "nothing is written before it is drained";
  EXPECT_EQ(logger.drain(), 1u);
  ASSERT_EQ(sink->lines.size(), 1u);
  EXPECT_TRUE(contains(sink->lines[0], "[WARN] attitude (test_logger.cpp:"));
  EXPECT_TRUE(contains(sink->lines[0], ", cycle 17): force 12.5 N above 10 N"));
}

TEST(LoggerTest, Levels) {
  Logger logger;
  auto sink = std::make_shared<ListSink>();
  logger.addSink(sink);
  logger.log(LogLevel::Debug, "a", "hidden");
  logger.log(LogLevel::Info, "a", "shown");
  logger.setLevel(LogLevel::Error);
  logger.log(LogLevel::Warning, "a", "hidden too");
  logger.log(LogLevel::Error, "a", "shown too");
  logger.drain();
  EXPECT_EQ(sink->lines.size(), 2u);
}

TEST(LoggerTest, LongTextsAreCutNotOverrun) {
  Logger logger;
  auto sink = std::make_shared<ListSink>();
  logger.addSink(sink);
  logger.log(LogLevel::Info, std::string(500, 's'), std::string(5000, 't'), "f", 1);
  logger.drain();
  ASSERT_EQ(sink->lines.size(), 1u);
  EXPECT_LT(sink->lines[0].size(), 400u);
}

TEST(LoggerTest, FullRingDropsAndCounts) {
  Logger logger(8);
  for (int i = 0; i < 20; ++i) logger.log(LogLevel::Info, "a", "x");
  EXPECT_EQ(logger.dropped(), 12u);
  EXPECT_EQ(logger.drain(), 8u);
  logger.log(LogLevel::Info, "a", "x");
  EXPECT_EQ(logger.drain(), 1u);
}

TEST(LoggerTest, FileSinkWritesTheFileThatWasNamed) {
  const std::string path = ::testing::TempDir() + "/ctrl_more_test.log";
  std::remove(path.c_str());
  {
    Logger logger;
    logger.addSink(std::make_shared<FileLogSink>(path));
    logger.log(LogLevel::Error, "a", "kept");
  }
  std::ifstream stream(path);
  std::string line;
  std::getline(stream, line);
  EXPECT_EQ(line, "[ERROR] a: kept");
  EXPECT_THROW(FileLogSink("/nowhere/x.log"), std::runtime_error);
}

TEST(LoggerTest, ManyProducersLoseNothing) {
  Logger logger(1 << 15);
  auto sink = std::make_shared<ListSink>();
  logger.addSink(sink);
  logger.startDraining(1);
  std::vector<std::thread> producers;
  for (int p = 0; p < 4; ++p) {
    producers.emplace_back([&logger, p] {
      for (int i = 0; i < 5000; ++i) {
        logger.log(LogLevel::Info, "p" + std::to_string(p), std::to_string(i));
      }
    });
  }
  for (auto& producer : producers) producer.join();
  logger.drain();
  ASSERT_EQ(sink->lines.size() + logger.dropped(), 20000u);
  // In the order of each producer.
  std::map<std::string, int> last;
  for (const std::string& line : sink->lines) {
    const std::string who = line.substr(7, 2);
    const int number = std::stoi(line.substr(11));
    if (last.count(who)) EXPECT_GT(number, last[who]);
    last[who] = number;
  }
}

std::vector<std::string> linesOf(Logger& logger) {
  auto sink = std::make_shared<ListSink>();
  logger.addSink(sink);
  logger.drain();
  return sink->lines;
}

TEST(LoggerTest, NumbersReplaceTheirPlaceholders) {
  Logger logger;
  const LogSource source(&logger, "a");
  source.write(LogLevel::Info, "", 0, "{} {} {} {}", 1, 2.5, -3, 1e9);
  source.write(LogLevel::Info, "", 0, "{} and {}", 1);
  source.write(LogLevel::Info, "", 0, "{x} y} {} {", 5, 6);
  source.write(LogLevel::Info, "", 0, "none");
  logger.log(LogLevel::Info, "a", "plain {}", "f.cpp");
  EXPECT_EQ(linesOf(logger),
            (std::vector<std::string>{"[INFO] a: 1 2.5 -3 1e+09", "[INFO] a: 1 and {}",
                                      "[INFO] a: {x} y} 5 {", "[INFO] a: none",
                                      "[INFO] a (f.cpp:0): plain {}"}));
}

struct CountingSink : LogSink {
  std::atomic<int> records{0};
  void write(const LogRecord&) override { ++records; }
};

TEST(LoggerTest, ADrainingThreadWritesByItselfAndIsStartedOnce) {
  auto sink = std::make_shared<CountingSink>();
  {
    Logger logger;
    logger.addSink(sink);
    logger.startDraining(1);
    logger.startDraining(1);
    logger.log(LogLevel::Info, "a", "x");
    for (int i = 0; i < 20000 && sink->records == 0; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    EXPECT_EQ(sink->records, 1);
  }
  EXPECT_EQ(sink->records, 1);
}

TEST(LoggerTest, ThrottleCountsFromTheLastRecordThatPassed) {
  LogThrottle throttle(1000);
  EXPECT_TRUE(throttle.pass(5000));
  EXPECT_FALSE(throttle.pass(5999));
  EXPECT_TRUE(throttle.pass(6000));
  EXPECT_FALSE(throttle.pass(6500));
  EXPECT_FALSE(throttle.pass(6999)) << "what did not pass does not count";
  EXPECT_TRUE(throttle.pass(7000));
}

}  // namespace
}  // namespace ctrl_more
