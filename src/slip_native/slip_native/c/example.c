/* Answers the recorded run of `slip-vic export` as a real-time loop does, and compares every byte with it.
 *
 *     cc -O2 example.c -L. -lslip_vic -lm -Wl,-rpath,'$ORIGIN' -o example && ./example run.bin
 *
 * On an arm of your own the samples come from its interface, and Pinocchio gives what run.bin has of the arm.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "slip_vic.h"

#define MOST_ARMS 4

static int64_t whole(const double **words) {
  int64_t value;
  memcpy(&value, (*words)++, sizeof value);
  return value;
}

static const double *numbers(const double **words, int64_t count) {
  const double *first = *words;
  *words += count;
  return first;
}

int main(int count, char **names) {
  FILE *file = count == 2 ? fopen(names[1], "rb") : NULL;
  if (file == NULL) return fprintf(stderr, "usage: example run.bin\n"), 2;
  fseek(file, 0, SEEK_END);
  size_t bytes = (size_t)ftell(file);
  double *run = malloc(bytes);
  rewind(file);
  if (run == NULL || fread(run, 1, bytes, file) != bytes) return fprintf(stderr, "%s: cannot be read\n", names[1]), 2;
  fclose(file);

  const double *words = run;
  const int64_t arms = whole(&words), rows = whole(&words), ticks = whole(&words), n_state = whole(&words);
  const int64_t n_config = arms * (int64_t)(sizeof(SlipVic_ControllerConfig) / 8);
  const int64_t n_exchange = arms * (int64_t)((sizeof(SlipVic_CycleInputs) + sizeof(SlipVic_CycleOutputs)) / 8);
  double *state = malloc((size_t)n_state * 8), *exchange = malloc((size_t)n_exchange * 8);
  if (arms > MOST_ARMS || state == NULL || exchange == NULL) return fprintf(stderr, "%s: no run\n", names[1]), 2;
  memcpy(state, numbers(&words, n_state), (size_t)n_state * 8);
  SlipVic_ArmState *rows_of = (SlipVic_ArmState *)((SlipVic_TaskState *)state + 1);
  const SlipVic_ControllerConfig *config = NULL;
  int64_t differ = 0, commands = 0;

  for (int64_t tick = 0; tick < ticks; ++tick) {
    if (whole(&words)) config = (const void *)numbers(&words, n_config); /* a tare has measured noise */
    for (int64_t samples = whole(&words); samples > 0; --samples) {
      const int64_t slip = whole(&words), arm = whole(&words), contact = whole(&words), stamp = whole(&words);
      const int64_t arrival = whole(&words), valid = whole(&words);
      const double *six = numbers(&words, 6);
      if (slip)
        slip_vic_receive_slip(config + arm, rows_of + arm, contact, stamp, six, valid, 0, arrival);
      else
        slip_vic_receive_wrench(config + arm, rows_of + arm, contact, stamp, six, 0, arrival);
    }
    int64_t now[MOST_ARMS], reason[MOST_ARMS];
    for (int64_t k = 0; k < arms; ++k) {
      const int64_t n = whole(&words);
      now[k] = whole(&words);
      const double *q = numbers(&words, n), *qd = numbers(&words, n), *effort = numbers(&words, n);
      reason[k] = slip_vic_receive_joint_state(config + k, rows_of + k, n, now[k], q, qd, effort, 0, now[k], 1);
    }
    const double *recorded = numbers(&words, n_exchange);
    const SlipVic_CycleInputs *given = (const void *)recorded;
    memset(exchange, 0, (size_t)n_exchange * 8);
    SlipVic_CycleInputs *inputs = (SlipVic_CycleInputs *)exchange;
    for (int64_t k = 0; k < arms; ++k)
      if (slip_vic_begin_answer(config + k, rows_of + k, inputs + k, now[k], 0, given[k].missing, reason[k]))
        inputs[k].arm = given[k].arm; /* Pinocchio, at rows_of[k].joint.answers */
    const int64_t answered = slip_vic_cycle(config, state, exchange, arms, rows);
    for (int64_t k = 0; k < arms; ++k) commands += answered >> k & 1;
    differ += memcmp(exchange, recorded, (size_t)n_exchange * 8) != 0;
  }
  differ += memcmp(state, numbers(&words, n_state), (size_t)n_state * 8) != 0;
  printf("%lld cycles, %lld commands, %lld differ, %lld faults\n", (long long)ticks, (long long)commands,
         (long long)differ, (long long)slip_vic_faults());
  free(run), free(state), free(exchange);
  return differ != 0 || slip_vic_faults() != 0;
}
