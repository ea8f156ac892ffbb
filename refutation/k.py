import sys, traceback
sys.dont_write_bytecode=True
S="/work/next/catkin_ws/src/"
sys.path.insert(0,S+"coglab_smach/test")
from coglab_sim.virtual_world import DT, World
from coglab_smach.simulated import world_ports as w
from coglab_objects.database import ObjectDatabase, objects_folder
from port_contracts import SUITES, Place
def place(name):
    rig=World(1)
    def sleep(d):
        for _ in range(max(1,round(d/DT))): rig.step()
    sleep(1.0)
    db=ObjectDatabase(objects_folder()); db.reload()
    port={"hand":lambda:w.VirtualHand(rig),"perception":lambda:w.VirtualPerception(rig),"contact":lambda:w.VirtualContact(rig),"database":lambda:w.VirtualDatabase(db)}[name]()
    fr=(lambda: setattr(rig.hand,"dead",True)) if name=="hand" else (lambda:None)
    th=(lambda: setattr(rig.hand,"dead",False)) if name=="hand" else (lambda:None)
    return Place(port, lambda: rig.t, sleep, fr, th)
for name in ("hand","perception","database","contact"):
    s=SUITES[name](place(name))
    for t in [n for n in vars(SUITES[name]) if n.startswith("test_")]:
        try: s.begin(); getattr(s,t)(); print(name,t,"ok",flush=True)
        except BaseException as e: print(name,t,"FAILS",type(e).__name__,str(e)[:110], traceback.extract_tb(e.__traceback__)[-1].lineno,flush=True)
