#!/usr/bin/env python3
"""Kills a checkpointing render repeatedly, resumes it each time, and compares with an uninterrupted run.

kill.py OSCURA SCENE [KILLS] [further options of 'oscura render']

After each kill, the picture must be absent or whole, and the checkpoint absent or whole: 'oscura merge --allow-missing' reads it.
Then the same with a disk that is full: a tmpfs of a few megabytes, where mounting one is allowed."""
import os, random, subprocess, sys, tempfile, time

oscura, scene = map(os.path.abspath, sys.argv[1:3])
kills = int(sys.argv[3]) if len(sys.argv) > 3 else 50
options = ['--reproducible', '--float', '--aov', 'all'] + (sys.argv[4:] or ['--width', '160', '--spp', '600'])


def render(folder, output, more):
    command = [oscura, 'render', scene, '-o', os.path.join(folder, output)] + options + more
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)


def bytes_of(folder, name):
    path = os.path.join(folder, name)
    return open(path, 'rb').read() if os.path.exists(path) else None


def finish(child, code=0):
    output = child.communicate()[1].decode()
    assert child.returncode == code, (child.returncode, output)
    return output


def kill_test(folder):
    start = time.time()
    finish(render(folder, 'whole.exr', []))
    seconds = time.time() - start
    whole = bytes_of(folder, 'whole.exr')
    kept = ['--checkpoint', os.path.join(folder, 'c.part'), '--checkpoint-interval', '0.05', '--resume']
    picture, before_first, samples = 0, 0, []
    for _ in range(kills):
        child = render(folder, 'a.exr', kept)
        # Until the picture is there and sometimes a little longer.
        time.sleep(random.uniform(0.0, 0.25 * seconds))
        child.kill()
        child.communicate()
        now = bytes_of(folder, 'a.exr')
        assert now in (None, whole), 'a broken picture has its final name'
        if now is not None:
            picture += 1
            os.remove(os.path.join(folder, 'a.exr'))
            os.remove(os.path.join(folder, 'c.part'))
        if bytes_of(folder, 'c.part') is None:
            before_first += 1
            continue
        read = [oscura, 'merge', os.path.join(folder, 'c.part'), '-o', os.path.join(folder, 'm.exr'), '--allow-missing']
        assert subprocess.run(read, capture_output=True).returncode == 0, 'a broken checkpoint has its final name'
    finish(render(folder, 'a.exr', kept))
    assert bytes_of(folder, 'a.exr') == whole, 'another picture'
    left = [name for name in os.listdir(folder) if name.endswith('.tmp')]
    print(f'{kills} kills (a run takes {seconds:.1f} s): {picture} after the picture was there, {before_first} without a '
          f'checkpoint; the last picture is bit-identical; {len(left)} temporary files are left behind by kills')


def full_disk(folder):
    small = os.path.join(folder, 'small')
    os.mkdir(small)
    mounted = subprocess.run(['mount', '-t', 'tmpfs', '-o', 'size=4m', 'tmpfs', small], capture_output=True)
    if mounted.returncode:
        print('full disk: skipped, a tmpfs can not be mounted here:', mounted.stderr.decode().strip())
        return
    try:
        kept = ['--checkpoint', os.path.join(small, 'c.part'), '--checkpoint-interval', '0.05', '--resume', '--plan', '600']
        few = ['--spp', '64', '--width', '64', '--aov', 'depth']
        command = [oscura, 'render', scene, '-o', os.path.join(small, 'a.exr'), '--reproducible'] + few + kept
        assert subprocess.run(command, capture_output=True).returncode == 0
        before = [bytes_of(small, name) for name in ('a.exr', 'c.part')]
        left = os.statvfs(small).f_bavail * os.statvfs(small).f_frsize
        open(os.path.join(small, 'filler'), 'wb').write(b'x' * max(0, left - 8192))
        more = [{'64': '128'}.get(word, word) if at == command.index('--spp') + 1 else word for at, word in enumerate(command)]
        full = subprocess.run(more, capture_output=True)
        assert full.returncode == 4, (full.returncode, full.stderr.decode())
        assert [bytes_of(small, name) for name in ('a.exr', 'c.part')] == before, 'something was harmed'
        os.remove(os.path.join(small, 'filler'))
        assert subprocess.run(more, capture_output=True).returncode == 0
        print('full disk: exit code 4, the older checkpoint and picture as they were; goes on when there is space again')
    finally:
        subprocess.run(['umount', small])


with tempfile.TemporaryDirectory() as folder:
    random.seed(1)
    kill_test(folder)
    full_disk(folder)
