/* A recorder for jointrig in C: a header, then blocks of samples on standard output.
 *
 *     cc -O2 -o bridge bridge.c -lm
 *     jointrig info --device "bridge:./bridge"
 *
 * It makes up its samples: once a second a hammer hits with 50 N, and an accelerometer answers at
 * 200 Hz. Replace sample() by the library of your recorder; docs/bridge.md describes the format. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { RATE = 25600, CHANNELS = 2, SCANS = 1280 };

/* One scan: force in N, acceleration in m/s^2. */
static void sample(uint64_t scan, float *to) {
    double t = (double)(scan % RATE) / RATE - 0.5; /* s after the hit */
    to[0] = t >= 0 && t < 1e-3 ? (float)(50 * sin(M_PI * t / 1e-3)) : 0;
    to[1] = t >= 0 ? (float)(30 * exp(-20 * t) * sin(2 * M_PI * 200 * t)) : 0;
}

/* Bytes of a block's head, little-endian on any computer. */
static void put(unsigned char *to, uint64_t value, int bytes) {
    for (int i = 0; i < bytes; i++) to[i] = (unsigned char)(value >> (8 * i));
}

int main(int argc, char **argv) {
    uint64_t blocks = argc > 1 ? strtoull(argv[1], NULL, 10) : UINT64_MAX, scan = 0, lost = 0;
    printf("{\"jointrig_bridge\": 1, \"board\": \"example in C\", \"serial\": \"1\", \"rate_hz\": %d, "
           "\"sample\": \"f32\", \"held\": true, \"channels\": ["
           "{\"name\": \"force\", \"role\": \"hammer_force\", \"unit\": \"N\", \"full_scale\": 200}, "
           "{\"name\": \"acc\", \"unit\": \"m/s^2\", \"full_scale\": 100}]}\n", RATE);
    for (uint64_t block = 0; block < blocks; block++) {
        unsigned char head[24] = "JRBK", data[SCANS * CHANNELS * 4];
        put(head + 4, SCANS, 4);
        put(head + 8, lost, 8); /* scans that the recorder lost before this block */
        put(head + 16, 0, 4);   /* 1: more were lost, their number is unknown */
        for (int i = 0; i < SCANS; i++, scan++) {
            float values[CHANNELS];
            sample(scan, values);
            for (int channel = 0; channel < CHANNELS; channel++) {
                uint32_t bits;
                memcpy(&bits, &values[channel], 4);
                put(data + 4 * (CHANNELS * i + channel), bits, 4);
            }
        }
        lost = 0;
        if (fwrite(head, sizeof head, 1, stdout) != 1 || fwrite(data, sizeof data, 1, stdout) != 1) return 0;
        fflush(stdout); /* jointrig judges a hit when its block has come */
    }
    return 0;
}
