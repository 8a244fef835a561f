// The status strip, the banner of the verdict, keys, sounds, and the choice of the screen.
root.classList.add('scripted');
let screen=null,voice=null;
for(const[i,s]of SCREENS.entries()){
  s.button=el('button',{type:'button',title:`${s.title} (${i+1})`,on:{click:()=>go(s.key)}},s.title);
  $('screens').append(s.button);
}
function go(key){
  const s=SCREENS.find(s=>s.key===key);
  // without a campaign only the stream can be shown
  if(!state.whole||!s||!state.whole.file&&s!==scopeScreen)return;
  if(screen!==s){
    // a figure belongs to the screen that shows it
    alive.clear();shownFigures.clear();
    screen=s;
    $('main').replaceChildren();
    s.make($('main'));
    for(const o of SCREENS)o.button.setAttribute('aria-current',o===s?'page':'false');
  }
  wantStream(s.key==='scope'&&state.whole.can.stream&&!document.hidden);
  s.show('screen');
}
// a description of the current activity
function doing(w){
  const s=w.now.state;
  if(!s)return'';
  const c=s.cell===null?null:cellOf(s.cell),hit=c?`${nameOf(c)}, ${s.kept+1} of ${c.wanted}: `:'',since=((Date.now()-s.since_unix_ms)/1000).toFixed(1);
  return{
    'moving':()=>hit+'hammer and laser move',
    'move-by-hand':()=>`move hammer to ${c.impact}, laser to ${c.response} (${c.configuration})`,
    'settling':()=>`${hit}settling, ${since} s`,
    'strike-by-hand':()=>`${hit}strike ${c.impact} now`,
    'recording':()=>hit+'recording',
    'judging':()=>hit+'judging',
    'shaking':()=>w.now.shaker?.settled?'shaking, settled':'shaking, on the way',
    'watching':()=>'watching the channels',
    'ended':()=>'measuring has ended',
  }[s.what]?.()||'';
}
function strip(){
  const w=state.whole;
  if(!w){
    $('what').textContent=state.refused?'The server lets nobody in without the whole address that jointrig printed.':'Connecting …';
    return;
  }
  const p=w.progress,simulated=w.simulated||!!w.now.stream?.simulated;
  $('banner').classList.toggle('simulated',simulated);
  $('what').textContent=(simulated?'SIMULATED rig: ':'')+(w.file||'channels of the device');
  $('where').textContent=state.connected?!w.cells.length?'':p.complete?'complete':p.next===null?'ended':'next '+nameOf(w.cells[p.next]):'connection lost, trying again';
  $('doing').textContent=state.connected?doing(w):'';
  $('kept').textContent=p.wanted?`${p.kept} of ${p.wanted} kept`:'';
  const l=p.left;
  $('left').textContent=l?`left: cell ${duration(l.cell_s)}, ${w.cells[p.next].configuration} ${duration(l.configuration_s)}, all ${duration(l.campaign_s)}, until ${new Date(Date.now()+1000*l.campaign_s).toLocaleTimeString([],{hour:'2-digit',minute:'2-digit'})}`:'';
  const link=w.now.link||p,disk=w.now.disk;
  $('link').textContent=[link.lost_scans&&`${link.lost_scans} scans lost`,link.recovered_scans&&`${link.recovered_scans} sent again`,disk&&`${room(disk.free_bytes)} free`,scope.missed&&`${scope.missed} frames missed`,held&&'picture held (space)'].filter(Boolean).join(', ');
  $('write').hidden=$('end').hidden=!mayEdit();
  shakerScreen.button.hidden=!(w.levels.length||w.now.shaker||w.progress.wear_cycles);
  for(const s of SCREENS)if(s!==shakerScreen)s.button.hidden=!w.file&&s!==scopeScreen;
  scopeScreen.button.textContent=w.can.stream?'Scope':'Channels';
}
const room=bytes=>bytes>=1e9?(bytes/1e9).toFixed(bytes<1e10?1:0)+' GB':(bytes/1e6).toFixed(0)+' MB';
// updates the elapsed time between two messages
setInterval(()=>{if(!document.hidden&&state.whole?.now.state?.what==='settling')strip()},200);
// a refused hit stays visible until the next good one
function banner(hit){
  const v=$('verdict');
  v.hidden=!hit||hit.kept;
  if(v.hidden)return;
  const c=cellOf(hit.cell);
  v.dataset.verdict=hit.verdict;
  v.replaceChildren(el('b',{'aria-hidden':'true',className:'sign'},signOf(hit.verdict)),el('span',{},`${c?nameOf(c)+', ':''}attempt ${hit.attempt+1}: ${hit.verdict}: ${hit.sentence}`));
}
function beep(hit){
  if(!voice)return;
  const tones=hit.kept?[880]:hit.verdict==='overload'?[330,330,330]:[330,330];
  tones.forEach((f,i)=>{
    const o=voice.createOscillator(),g=voice.createGain(),t=voice.currentTime+.16*i;
    o.frequency.value=f;g.gain.setValueAtTime(.12,t);g.gain.exponentialRampToValueAtTime(1e-3,t+.13);
    o.connect(g).connect(voice.destination);o.start(t);o.stop(t+.14);
  });
}
function sound(){
  voice=voice?(voice.close(),null):new AudioContext();
  $('sound').setAttribute('aria-pressed',String(!!voice));
  $('sound').textContent=voice?'sound on':'sound off';
}
$('sound').addEventListener('click',sound);
$('write').addEventListener('click',noteDialog);
$('help').addEventListener('click',()=>$('keys').showModal());
$('light').addEventListener('click',()=>{
  const dark=root.dataset.light?root.dataset.light==='dark':matchMedia('(prefers-color-scheme: dark)').matches;
  root.dataset.light=dark?'light':'dark';
  for(const charts of alive.values())for(const c of charts)if(c.plot)c.plot.redraw();
});
addEventListener('keydown',e=>{
  if(e.ctrlKey||e.metaKey||e.altKey||e.target.closest('input,textarea'))return;
  const n=+e.key;
  if(n>=1&&n<=SCREENS.length){go(SCREENS[n-1].key);return}
  const w=state.whole,at=w?w.cells.findIndex(c=>c.id===looked()):-1;
  const act={
    j:()=>{chosen=w.cells[Math.min(at+1,w.cells.length-1)]?.id??null;go('cell')},
    k:()=>{chosen=w.cells[Math.max(at-1,0)]?.id??null;go('cell')},
    f:()=>{chosen=null;screen?.show('screen');strip()},
    m:sound,n:noteDialog,u:takeBack,
    K:()=>mayEdit()&&latest()&&overrule(latest().record,'keep'),D:()=>mayEdit()&&latest()&&overrule(latest().record,'drop'),
    '?':()=>$('keys').showModal(),
    ' ':()=>{held=!held;if(!held)screen?.show('screen');strip()},
  }[e.key];
  if(act&&w){act();e.preventDefault()}
});
// messages that came while the page was hidden are drawn once together
let due=false;
function draw(kind){
  if(due||held||document.hidden)return;
  due=true;
  requestAnimationFrame(()=>{due=false;if(!screen)go(state.whole.file?'now':'scope');else screen.show(kind)});
}
document.addEventListener('visibilitychange',()=>{wantStream(screen?.key==='scope'&&!!state.whole?.can.stream&&!document.hidden);draw('screen')});
onNews((kind,message)=>{
  strip();
  if(kind==='judged'){banner(message.hit);beep(message.hit)}
  if(kind==='snapshot')banner(latest());
  if(kind==='trouble'){const v=$('verdict');v.hidden=false;v.dataset.verdict='trouble';v.replaceChildren(el('b',{className:'sign','aria-hidden':'true'},'!'),el('span',{},message.what))}
  // no drawing for messages that only the strip shows or that the current screen does not show
  const own={signals:'scope',stream:'scope',shaker:'shaker',disk:'',state:'now',control:'now',link:''}[kind];
  if(state.whole&&(own===undefined||own===screen?.key))draw(kind);
});
strip();
if(token)connect();else{state.refused=true;strip()}
// for the tests
window.live={state,alive,go,looked,takeIn,scope,me};
